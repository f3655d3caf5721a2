"""Who waits at a red light is put among others; nobody else is."""

from __future__ import annotations

import numpy as np
import pytest

from agents.training.waiting import among_others, of_the_one_before
from di_envs.town.lanes import LightState
from tests.agents.training.test_turned_red import before_a_light

FIRST, SECOND = 0, 1


def two_moments(**changes):
    """One on its way, then one that stands at a red light, each with an obstacle of its own."""
    going = before_a_light(60.0, 8.0, np.arange(1, 9) * 4.0)
    at_red = {"line_m": 3.1, "speed": 0.0, "ways": np.zeros(8), "state": LightState.RED} | changes
    moments = np.concatenate([going, before_a_light(**at_red)])
    moments["obstacles"][:, 0, 0] = 11.0, 22.0
    moments["map_kinds"][:, 0, 0] = 1, 2
    return moments


def mixed(moments, share=1.0):
    return among_others(moments, moments["valid"] > 0, share, key=3).tolist()


def test_who_waits_has_anothers_surroundings_and_its_own_light_and_way():
    moments = two_moments()
    before = moments.copy()
    assert mixed(moments) == [False, True]
    assert moments["obstacles"][SECOND, 0, 0] == 11.0
    assert moments["map_kinds"][SECOND, 0, 0] == 1
    assert moments["traffic_lights"][SECOND, 0, 3] == LightState.RED
    for name in ("routing", "command", "target_point", "speed", "speed_history", "waypoints"):
        assert (moments[name] == before[name]).all()
    assert (moments[FIRST] == before[FIRST]).all()


def test_others_lights_show_anything_and_rows_that_are_not_there_stay_so():
    shown = set()
    for key in range(20):
        moments = two_moments()
        among_others(moments, moments["valid"] > 0, 1.0, key)
        shown.add(int(moments["traffic_lights"][SECOND, 1, 3]))
        assert not moments["traffic_lights"][SECOND, 2:].any()
    assert shown == {LightState.GREEN, LightState.YELLOW, LightState.RED}


@pytest.mark.parametrize(
    "changes",
    [
        {"state": LightState.GREEN},
        {"line_m": 15.0},
        {"speed": 1.0},
        {"ways": np.arange(1, 9) * 0.5},
    ],
)
def test_who_need_not_wait_there_keeps_its_own(changes):
    moments = two_moments(**changes)
    assert mixed(moments) == [False, False]
    assert moments["obstacles"][SECOND, 0, 0] == 22.0


def test_a_share_of_zero_mixes_none_and_what_they_see_is_the_ones_before():
    assert mixed(two_moments(), share=0.0) == [False, False]
    seen = np.arange(6.0).reshape(3, 2)
    which = np.array([False, True, False])
    assert of_the_one_before(seen, which).tolist() == [[0.0, 1.0], [0.0, 1.0], [4.0, 5.0]]
