"""The published controllers and rules, by arithmetic."""

from __future__ import annotations

import math

import numpy as np
import pytest

from agents.zoo.controls import PidT
from agents.zoo.interfuser.safety import (
    CREEP_STEPS,
    IGNORED_STEPS,
    RED_STEPS,
    STUCK_STEPS,
    WAY_M,
    SafetyMemory,
    creeping,
    free_m,
    obeying,
    objects_of,
    safe_speed_mps,
    way_of,
)
from di_envs.actions.controllers import ControllerMemory

AHEAD = np.array([[2.0, 0.0], [4.0, 0.0]], np.float32)
# x, y, yaw, length, width, speed
STANDS = np.array([[11.0, 0.0, 0.0, 4.0, 2.0, 0.0]])


def test_waypoints_two_metres_apart_are_four_metres_a_second_and_gain_throttle_below():
    control, _ = PidT().control(AHEAD, 3.0, ControllerMemory())
    # the error is clipped to 0.25: 5 x 0.25 is more than the pedal may
    assert control.tolist() == [0.75, 0.0, 0.0]


@pytest.mark.parametrize(("speed_mps", "brakes"), [(4.3, 0.0), (4.5, 1.0)])
def test_at_a_tenth_above_what_is_wanted_it_brakes_fully(speed_mps, brakes):
    control, _ = PidT().control(AHEAD, speed_mps, ControllerMemory())
    assert control[2] == brakes


def test_who_wants_a_third_of_a_metre_a_second_is_stopped_by_the_one_and_not_by_the_other():
    slow = np.array([[0.15, 0.0], [0.3, 0.0]], np.float32)
    assert PidT(brake_mps=0.4).control(slow, 0.0, ControllerMemory())[0][2] == 1.0
    assert PidT(brake_mps=0.1).control(slow, 0.0, ControllerMemory())[0][2] == 0.0


def test_an_aim_to_the_right_steers_right():
    right = np.array([[2.0, 2.0], [4.0, 4.0]], np.float32)
    control, _ = PidT().control(right, 2.0, ControllerMemory())
    assert control[1] == pytest.approx(1.25 * 0.5)  # 45 degrees are half a quarter turn


def test_a_car_eleven_metres_ahead_leaves_so_much_of_the_way_free():
    way = way_of(AHEAD, np.array([20.0, 0.0]))
    # its back is at 9 m, and boxes are 1.25 m longer: 8 m is the first place met, 7.5 m are free
    assert free_m(way, STANDS, 0.0) == 7.5
    assert free_m(way, np.zeros((0, 6)), 0.0) == WAY_M
    beside = STANDS + np.array([0.0, 3.0, 0.0, 0.0, 0.0, 0.0])
    assert free_m(way, beside, 0.0) == WAY_M
    drives = STANDS + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 2.0])
    assert free_m(way, drives, 1.0) == 9.5


def test_a_plan_to_stand_looks_towards_the_target():
    way = way_of(np.zeros((8, 2), np.float32), np.array([0.0, 10.0]))
    assert way[-1].tolist() == pytest.approx([0.0, WAY_M])


def test_the_speed_is_what_leaves_room_to_stop():
    assert safe_speed_mps((20.0, 20.0, 20.0), 3.0) == 5.0
    assert safe_speed_mps((2.0, 20.0, 20.0), 0.0) == 0.0  # nearer than 3 m
    assert safe_speed_mps((6.0, 6.0, 2.0), 3.0) == pytest.approx(2.5)  # 2 x 2 - 3 / 2
    assert safe_speed_mps((6.0, 1.5, 6.0), 3.0) == pytest.approx(3.0)  # 4 x 1.5 - 3


def test_the_map_is_read_by_its_cells():
    said = np.zeros((400, 8), np.float32)
    said[:, 0] = -9.0
    cell = 7 * 20 + 12  # 7 to 8 m ahead, 2 to 3 m to the right
    said[cell] = [9.0, 0.2, -0.1, math.log(4.0), math.log(2.0), 0.0, 1.0, 0.3]
    assert objects_of(said, 20) == pytest.approx(
        np.array([[7.7, 2.4, 0.0, 4.0, 2.0, 3.0]]), abs=1e-5
    )


def test_red_stops_until_it_has_been_waited_for_and_then_not_for_a_while():
    red, memory = np.array([0.9, 0.9, 0.0]), SafetyMemory()
    stopped = []
    for _ in range(RED_STEPS + IGNORED_STEPS + 2):
        stops, memory = obeying(red, 0.0, memory)
        stopped.append(stops)
    assert stopped.index(False) == RED_STEPS
    assert stopped.count(False) == IGNORED_STEPS
    assert not obeying(np.array([0.1, 0.9, 0.0]), 0.0, SafetyMemory())[0]  # of no line of ours


def test_a_stop_sign_holds_until_it_has_stood():
    sign, memory = np.array([0.9, 0.0, 0.9]), SafetyMemory()
    stops, memory = obeying(sign, 3.0, memory)
    assert stops
    stops, memory = obeying(sign, 0.0, memory)
    assert not stops
    stops, memory = obeying(sign, 2.0, memory)
    assert not stops


def test_who_has_stood_for_a_minute_creeps_for_some_decisions():
    memory, crept = SafetyMemory(), []
    for _ in range(STUCK_STEPS + CREEP_STEPS + 3):
        creeps, memory = creeping(0.0, memory)
        crept.append(creeps)
    assert crept.index(True) == STUCK_STEPS
    assert crept.count(True) == CREEP_STEPS
