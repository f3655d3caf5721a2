"""Green lights that are told red: only the light differs, and the way ends before its line."""

from __future__ import annotations

import numpy as np
import pytest

from agents.training.caching import MOMENT
from agents.training.turned_red import turned_red
from di_envs.prompt import ROUTING_POINTS
from di_envs.town.lanes import LightState

EVERY_S = 0.5


def before_a_light(line_m, speed, ways, *, state=LightState.GREEN):
    """A moment on a straight road, a line that many metres ahead, and metres gone afterwards."""
    moments = np.zeros(1, MOMENT)
    moments["routing"][0, :, 0] = np.arange(1, ROUTING_POINTS + 1)
    moments["routing"][0, :, 3] = 1.0
    moments["traffic_lights"][0, 0] = line_m, 0.0, 0.0, state, 1.0
    moments["traffic_lights"][0, 1] = line_m + 20.0, -10.0, np.pi / 2, LightState.GREEN, 1.0
    moments["signals"][0, 0] = line_m, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0
    moments["speed"] = speed
    moments["waypoints"][0, :, 0] = ways
    moments["valid"] = 1
    return moments


def turned(moments, share=1.0):
    """What became of a moment: done, its waypoints' x."""
    valid = moments["valid"] > 0
    done = turned_red(moments, valid, share, key=5)
    assert valid.all()
    return bool(done[0]), moments["waypoints"][0, :, 0]


def test_who_stands_at_the_line_and_was_to_go_stands_on():
    moments = before_a_light(3.1, 0.0, np.arange(1, 9) ** 2 * 0.4)
    done, ways = turned(moments)
    assert done
    assert ways == pytest.approx(0.0, abs=0.05)
    assert moments["traffic_lights"][0, :, 3].tolist()[:2] == [LightState.RED, LightState.GREEN]
    assert moments["signals"][0, 0, 3:7].tolist() == [1.0, 0.0, 0.0, 0.0]


def test_who_comes_to_it_drives_on_as_long_as_it_can_and_then_brakes_to_stand_before_it():
    # 10 m/s, 26.9 m are left before it stands: at 3 m/s2 it brakes over the last 16.7 of them
    _, ways = turned(before_a_light(30.0, 10.0, np.arange(1, 9) * 5.0))
    assert ways[:2] == pytest.approx([5.0, 10.0], abs=0.05)
    gone_s = np.arange(1, 9) * EVERY_S - (26.9 - 100.0 / 6.0) / 10.0
    expected = 26.9 - 100.0 / 6.0 + 10.0 * gone_s - 1.5 * gone_s**2
    assert ways[3:7] == pytest.approx(expected[3:7], abs=0.3)
    assert ways[-1] == pytest.approx(26.9, abs=0.3)


def test_who_must_brake_harder_does_and_who_cannot_stop_is_let_pass():
    done, ways = turned(before_a_light(15.0, 10.0, np.arange(1, 9) * 5.0))
    assert done
    assert ways[-1] == pytest.approx(11.9, abs=0.3)  # 4.2 m/s2
    assert turned(before_a_light(12.0, 10.0, np.arange(1, 9) * 5.0))[0] is False  # 5.6 m/s2


@pytest.mark.parametrize(
    ("line_m", "state"),
    [(30.0, LightState.YELLOW), (30.0, LightState.RED), (0.5, LightState.GREEN)],
)
def test_only_a_green_light_that_is_still_ahead_is_turned(line_m, state):
    ways = np.arange(1, 9) * 5.0
    done, kept = turned(before_a_light(line_m, 10.0, ways, state=state))
    assert not done
    assert kept.tolist() == ways.tolist()


def test_a_share_of_zero_turns_none_and_a_bend_is_followed_as_it_was_driven():
    ways = np.arange(1, 9) * 5.0
    assert turned(before_a_light(30.0, 10.0, ways), share=0.0)[0] is False
    moments = before_a_light(30.0, 10.0, ways)
    moments["waypoints"][0, :, 1] = [0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    turned_red(moments, moments["valid"] > 0, 1.0, 5)
    x, y = moments["waypoints"][0, 4]
    assert y == pytest.approx((x - 10.0) / 5.0, abs=0.02)
