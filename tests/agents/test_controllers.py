"""Waypoints to controls, by arithmetic."""

from __future__ import annotations

import math

import numpy as np
import pytest

from agents.controllers import (
    ControllerMemory,
    PIDGains,
    WaypointControllerConfig,
    pid_step,
    waypoints_to_control,
)

CONFIG = WaypointControllerConfig()


def straight(speed_mps: float) -> np.ndarray:
    """Waypoints of a straight drive at constant speed."""
    return np.array([[speed_mps * 0.5 * (i + 1), 0.0] for i in range(4)])


def test_the_integral_is_the_mean_of_the_window_and_the_derivative_the_last_step():
    gains = PIDGains(proportional=1.0, integral=10.0, derivative=100.0, window=2)
    output, errors = pid_step(gains, (), 1.0)
    assert (output, errors) == (1.0, (1.0,))
    output, errors = pid_step(gains, errors, 3.0)
    assert output == 3.0 + 10.0 * 2.0 + 100.0 * 2.0
    output, errors = pid_step(gains, errors, 4.0)
    assert output == 4.0 + 10.0 * 3.5 + 100.0
    assert errors == (3.0, 4.0)


def test_a_car_that_should_drive_faster_opens_the_throttle():
    control, memory = waypoints_to_control(straight(5.0), 0.0, ControllerMemory(), CONFIG)
    assert control.tolist() == [0.75, 0.0, 0.0]  # 5 x 0.25 is over the limit
    assert memory.speed == (0.25,)


def test_a_car_that_is_ten_percent_too_fast_brakes():
    control, _ = waypoints_to_control(straight(5.0), 5.6, ControllerMemory(), CONFIG)
    assert control.tolist() == [0.0, 0.0, 1.0]
    control, _ = waypoints_to_control(straight(5.0), 5.4, ControllerMemory(), CONFIG)
    assert control[2] == 0.0


def test_waypoints_at_a_standstill_brake():
    control, _ = waypoints_to_control(straight(0.1), 0.0, ControllerMemory(), CONFIG)
    assert control[2] == 1.0


def test_waypoints_to_the_right_steer_right_and_mirrored_ones_left():
    points = np.array([[2.0, 1.0], [4.0, 2.0]])
    right, _ = waypoints_to_control(points, 5.0, ControllerMemory(), CONFIG)
    left, _ = waypoints_to_control(points * [1, -1], 5.0, ControllerMemory(), CONFIG)
    assert right[1] == pytest.approx(1.25 * math.atan2(1.5, 3.0) / (math.pi / 2))
    assert left[1] == -right[1]


def test_the_wheel_is_straight_at_a_standstill():
    control, _ = waypoints_to_control(
        np.array([[2.0, 1.0], [4.0, 2.0]]), 0.0, ControllerMemory(), CONFIG
    )
    assert control[1] == 0.0


@pytest.mark.parametrize("points", [np.zeros((1, 2)), np.zeros((4, 3)), np.full((4, 2), np.nan)])
def test_bad_waypoints_are_refused(points: np.ndarray):
    with pytest.raises(ValueError, match="waypoints"):
        waypoints_to_control(points, 1.0, ControllerMemory(), CONFIG)
