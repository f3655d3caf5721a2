"""Turns waypoints into controls with two PID controllers, as end-to-end drivers do.

Steering is that of Chen et al., Learning by Cheating, CoRL 2019, and Prakash et al., Multi-Modal
Fusion Transformer for End-to-End Autonomous Driving (TransFuser), CVPR 2021: its gains, its aim
point; DriveInsight (Li et al., 2024) sends its waypoints through the same. What we changed: the
window of past errors is a value that is passed in and out, and waypoints are in our ego frame (x
ahead, y right; a positive angle steers right).

Speed is not theirs. They brake fully or not at all, for the speed that is planned between 0.5 and
1 s ahead, so a car slows down half a second early and creeps up to each stop line, now at 0.2 and
now at 1.2 m/s, which policies took for having stopped. Here a controller says how hard to brake or
to gain speed, and the ego's own model says with which pedals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from di_envs.world.dynamics import EgoModel, pedals

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
    """How waypoints become controls.

    Attributes:
        waypoint_dt_s: Time between waypoints.
        turn: From the bearing of the aim, as a share of a quarter turn, to the wheel -1..1.
        speed: From the error of the mean speed up to the first waypoint [m/s] to an acceleration
            [m/s²]. A car that gains speed evenly is off by half of what it gains over that time, so
            `2 / waypoint_dt_s` is the gain with which it does what was planned.
        hold_mps: Planned to be slower than this up to the second waypoint, it is brought to stand.
        hold_mps2: … with at least this deceleration.
        min_turn_speed_mps: Below it the wheel is kept straight.
        model: Of the car whose pedals these are.
    """

    waypoint_dt_s: float = 0.5
    turn: PIDGains = field(
        default_factory=lambda: PIDGains(proportional=1.25, integral=0.75, derivative=0.3)
    )
    speed: PIDGains = field(
        default_factory=lambda: PIDGains(proportional=4.0, integral=0.0, derivative=0.0)
    )
    hold_mps: float = 0.6
    hold_mps2: float = 1.0
    min_turn_speed_mps: float = 0.01
    model: EgoModel = field(default_factory=EgoModel)

    def __post_init__(self) -> None:
        for name in ("waypoint_dt_s", "hold_mps2"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")


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
    """The control that follows waypoints: their first one in time, the wheel by the first two.

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
    planned_mps = math.hypot(x0, y0) / config.waypoint_dt_s
    wanted_mps2, speed_errors = pid_step(config.speed, memory.speed, planned_mps - speed_mps)
    if math.hypot(x1, y1) < 2.0 * config.waypoint_dt_s * config.hold_mps:
        wanted_mps2 = min(wanted_mps2, -config.hold_mps2)
    throttle, brake = pedals(wanted_mps2, speed_mps, config.model.parameters())
    # A full turn of the wheel stands for a quarter turn of the aim.
    angle = math.atan2(0.5 * (y0 + y1), 0.5 * (x0 + x1)) / (0.5 * math.pi)
    if speed_mps < config.min_turn_speed_mps:
        angle = 0.0
    steer, turn_errors = pid_step(config.turn, memory.turn, angle)
    return (
        np.array([throttle, min(max(steer, -1.0), 1.0), brake], np.float32),
        ControllerMemory(turn=turn_errors, speed=speed_errors),
    )
