"""From keys and sticks to controls, by arithmetic."""

from __future__ import annotations

import numpy as np
import pytest

from agents import load_agent
from agents.base import make_control
from agents.human.hands import MOST_THROTTLE, control_of_keys, control_of_pad
from agents.ownership import code_of_others

NOTHING = make_control(0.0, 0.0, 0.0)


def held(*keys: str, before=NOTHING, speed_mps=0.0, times=1):
    for _ in range(times):
        before = control_of_keys(set(keys), before, speed_mps, 0.1)
    return before.tolist()


def test_throttle_rises_while_its_key_is_down_and_is_gone_with_it():
    assert held("up") == pytest.approx([0.16, 0.0, 0.0])
    assert held("w", times=3) == pytest.approx([0.48, 0.0, 0.0])
    assert held("up", times=50)[0] == pytest.approx(MOST_THROTTLE)
    assert held(before=make_control(0.8, 0.0, 0.0)) == [0.0, 0.0, 0.0]


def test_the_brake_wins_over_the_throttle_and_space_brakes_at_once():
    assert held("up", "down", before=make_control(0.5, 0.0, 0.0)) == pytest.approx([0, 0, 0.25])
    assert held("up", "space") == [0.0, 0.0, 1.0]


def test_the_wheel_goes_out_slowly_and_back_fast_and_less_far_at_speed():
    assert held("right")[1] == pytest.approx(0.12)
    assert held("a", times=50)[1] == pytest.approx(-1.0)
    assert held("right", speed_mps=8.0, times=50)[1] == pytest.approx(0.5)  # 4 m/s over 8 m/s
    assert held(before=make_control(0.0, 0.5, 0.0))[1] == pytest.approx(0.2)  # 3.0 a second
    assert held("left", before=make_control(0.0, 0.5, 0.0))[1] == pytest.approx(0.2)
    assert held("left", "right")[1] == 0.0


def test_a_stick_near_its_middle_is_at_rest_and_triggers_are_pedals():
    assert control_of_pad(0.05, 0.0, 0.0).tolist() == [0.0, 0.0, 0.0]
    assert control_of_pad(-1.0, 0.25, 0.75).tolist() == [0.25, -1.0, 0.75]
    halfway = (0.54 - 0.08) / 0.92  # 0.5
    assert control_of_pad(0.54, 0.0, 0.0)[1] == np.float32(halfway**2)


def test_a_person_is_nobodys_code_and_drives_by_what_there_is():
    assert code_of_others("human:keyboard") == ""
    assert load_agent("human:gamepad").requires.track == "PRIVILEGED"
    with pytest.raises(ValueError, match="keyboard, gamepad; got 'feet'"):
        load_agent("human:feet")


def test_without_a_window_nobody_can_be_asked():
    with pytest.raises(RuntimeError, match="driveinsight watch"):
        load_agent("human:keyboard").start(None, 0)
