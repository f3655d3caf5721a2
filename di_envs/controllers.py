"""Turns waypoints into controls with two PID controllers, as end-to-end drivers do.

Source: Chen et al., Learning by Cheating, CoRL 2019, and Prakash et al., Multi-Modal Fusion
Transformer for End-to-End Autonomous Driving (TransFuser), CVPR 2021, whose gains and aim point
these are; DriveInsight (Li et al., 2024) sends its waypoints through the same. What we changed: the
window of past errors is a value that is passed in and out, and waypoints are in our ego frame
(x ahead, y right), so a positive angle steers right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Control = NDArray[np.float32]  # (3,) throttle 0..1, steer -1..1 (positive right), brake 0..1


@dataclass(frozen=True, kw_only=True)
class PIDGains:
    """A PID controller over a sliding window of errors: the integral is the window's mean."""

    proportional: float
    integral: float
    derivative: float
    window: int = 40  # calls

    def __post_init__(self) -> None:
        if self.window < 2:
            raise ValueError(f"window must hold at least two errors, not {self.window}")


Errors = tuple[float, ...]  # the latest errors, oldest first


def pid_step(gains: PIDGains, errors: Errors, error: float) -> tuple[float, Errors]:
    """One step: the output for `error`, and the window of errors with it at its end."""
    errors = (*errors, error)[-gains.window :]
    if len(errors) < 2:
        return gains.proportional * error, errors
    mean, difference = math.fsum(errors) / len(errors), errors[-1] - errors[-2]
    output = gains.proportional * error + gains.integral * mean + gains.derivative * difference
    return output, errors


@dataclass(frozen=True, kw_only=True)
class WaypointControllerConfig:
    """How waypoints become controls; the defaults are TransFuser's."""

    waypoint_dt_s: float = 0.5  # time between waypoints
    turn: PIDGains = field(
        default_factory=lambda: PIDGains(proportional=1.25, integral=0.75, derivative=0.3)
    )
    speed: PIDGains = field(
        default_factory=lambda: PIDGains(proportional=5.0, integral=0.5, derivative=1.0)
    )
    max_throttle: float = 0.75
    brake_speed_mps: float = 0.4  # brakes when it should drive slower than this
    brake_ratio: float = 1.1  # brakes when it is this much faster than it should be
    clip_delta_mps: float = 0.25  # greatest speed error that the controller sees
    min_turn_speed_mps: float = 0.01  # below it the wheel is kept straight

    def __post_init__(self) -> None:
        if not self.waypoint_dt_s > 0.0:
            raise ValueError(f"waypoint_dt_s must be positive, not {self.waypoint_dt_s}")
        if not 0.0 <= self.max_throttle <= 1.0:
            raise ValueError(f"max_throttle must lie in [0, 1], not {self.max_throttle}")
        if not self.brake_ratio >= 1.0:
            raise ValueError(f"brake_ratio must be at least 1, not {self.brake_ratio}")


@dataclass(frozen=True, kw_only=True)
class ControllerMemory:
    """Past errors of both controllers, oldest first."""

    turn: Errors = ()
    speed: Errors = ()


def waypoints_to_control(
    waypoints: NDArray[np.floating],
    speed_mps: float,
    memory: ControllerMemory,
    config: WaypointControllerConfig,
) -> tuple[Control, ControllerMemory]:
    """The control that follows waypoints: speed from their spacing, steering from their middle.

    Args:
        waypoints: (T, 2) future positions x, y at equal times, ego frame [m]; T at least 2.
        speed_mps: Present forward speed.
        memory: What the last call returned; `ControllerMemory()` at first.
        config: Gains and limits.

    Returns:
        The control and the memory for the next call.

    Raises:
        ValueError: If there are fewer than two waypoints, or a number is not finite.
    """
    points = np.asarray(waypoints, dtype=np.float64)
    if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] != 2:
        raise ValueError(f"waypoints must be (T, 2) with T >= 2, not {points.shape}")
    if not (np.isfinite(points).all() and math.isfinite(speed_mps)):
        raise ValueError("waypoints and speed must be finite")
    (x0, y0), (x1, y1) = points[0], points[1]
    desired_mps = math.hypot(x1 - x0, y1 - y0) / config.waypoint_dt_s
    brake = desired_mps < config.brake_speed_mps or speed_mps > config.brake_ratio * desired_mps
    delta = min(max(desired_mps - speed_mps, 0.0), config.clip_delta_mps)
    pedal, speed_errors = pid_step(config.speed, memory.speed, delta)
    throttle = 0.0 if brake else min(max(pedal, 0.0), config.max_throttle)
    # A full turn of the wheel stands for a quarter turn of the aim.
    angle = math.atan2(0.5 * (y0 + y1), 0.5 * (x0 + x1)) / (0.5 * math.pi)
    if speed_mps < config.min_turn_speed_mps:
        angle = 0.0
    steer, turn_errors = pid_step(config.turn, memory.turn, angle)
    return (
        np.array([throttle, min(max(steer, -1.0), 1.0), float(brake)], np.float32),
        ControllerMemory(turn=turn_errors, speed=speed_errors),
    )
