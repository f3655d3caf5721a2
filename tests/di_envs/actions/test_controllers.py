"""Waypoints to controls, by arithmetic."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from di_envs.actions.controllers import (
    ControllerMemory,
    PIDGains,
    WaypointControllerConfig,
    pid_step,
    waypoints_to_control,
)
from di_envs.world.dynamics import longitudinal_acceleration

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


@settings(deadline=None)
@given(speed=st.floats(1.0, 20.0), wanted=st.floats(-6.0, 2.0))
def test_the_pedals_give_the_acceleration_that_was_planned(speed: float, wanted: float):
    times = 0.5 * np.arange(1, 5)
    ahead = speed * times + 0.5 * wanted * times**2
    assume(ahead[1] > CONFIG.hold_mps)
    points = np.stack([ahead, np.zeros(4)], axis=1)
    control, memory = waypoints_to_control(points, speed, ControllerMemory(), CONFIG)
    throttle, steer, brake = control.tolist()
    got = longitudinal_acceleration(speed, throttle, brake, CONFIG.model.parameters())
    assert got == pytest.approx(wanted, abs=1e-5)  # controls are float32
    assert steer == 0.0
    assert memory.speed == pytest.approx((0.25 * wanted,), abs=1e-9)


def test_a_car_can_do_no_more_than_full_throttle():
    control, _ = waypoints_to_control(straight(15.0), 0.0, ControllerMemory(), CONFIG)
    assert control.tolist() == [1.0, 0.0, 0.0]


def test_a_car_that_is_to_creep_is_brought_to_stand():
    """A policy that stands is off by 0.2 m in half a second: creeping is not planned on purpose."""
    creeping = straight(0.4)
    moving, _ = waypoints_to_control(creeping, 0.4, ControllerMemory(), CONFIG)
    assert moving[2] > 0.0
    standing, _ = waypoints_to_control(creeping, 0.0, ControllerMemory(), CONFIG)
    assert standing.tolist() == [0.0, 0.0, 1.0]


def test_a_car_stops_where_it_was_planned():
    """From 10 m/s, by waypoints of even braking at 2.5 m/s² up to a line."""
    model, braking, line_m = CONFIG.model.parameters(), 2.5, 40.0
    place, speed, memory, times = 0.0, 10.0, ControllerMemory(), 0.5 * np.arange(1, 9)
    for _ in range(200):  # of 0.1 s
        target = min(10.0, math.sqrt(2.0 * braking * max(line_m - place, 0.0)))
        until = target / braking
        brake_from_m = line_m - 0.5 * braking * until**2
        lead = max(brake_from_m - place, 0.0) / max(target, 0.1)
        late = np.clip(times - lead, 0.0, until)
        ahead = target * np.minimum(times, lead) + target * late - 0.5 * braking * late**2
        points = np.stack([ahead, np.zeros(8)], axis=1)
        control, memory = waypoints_to_control(points, speed, memory, CONFIG)
        for _ in range(2):
            change = 0.05 * longitudinal_acceleration(speed, control[0], control[2], model)
            place += 0.05 * max(speed + 0.5 * change, 0.0)
            speed = max(speed + change, 0.0)
    assert speed == 0.0
    assert place == pytest.approx(line_m, abs=0.5)


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
