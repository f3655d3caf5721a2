"""Who drives the light-limited bound: its limits, where it may have to stop, how fast it may go.

A point mass on the route at the speed limit, held back by curves and by stop lines ahead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import SignalKind
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.dynamics import EgoModel
from di_envs.world.state import TICK_S

Float64 = NDArray[np.float64]

LONGEST_YELLOW_S = 3.5  # further ahead than that, arrivals are not of interest
CURVE_SPAN_M = 4.0  # a bend is measured over this much route, so that a kink is not a curve


@dataclass(frozen=True, kw_only=True)
class PerfectDriver:
    """A brisk driver that knows the route: limits of its acceleration, and where its nose is."""

    acceleration_mps2: float = 3.0
    braking_mps2: float = 3.0
    lateral_mps2: float = 3.0
    nose_m: float = (
        EgoModel().half_length_m
    )  # from the route position to the bumper that stays behind stop lines
    tail_m: float = EgoModel().half_length_m + 1.0  # and back to where the red-light rule looks


@dataclass(frozen=True, kw_only=True)
class StopPoint:
    """A place on the route where the driver may have to stand: its light, or -1 for a sign."""

    route_m: float
    light: int


def stop_points(town: Town, plan: RoutePlan, driver: PerfectDriver) -> list[StopPoint]:
    """Where the route crosses stop lines of lights and stop signs, nose behind the line."""
    lanes, signals = town.lanes, town.signals
    found = []
    for i in np.flatnonzero(plan.lane[1:] != plan.lane[:-1]) + 1:
        before, after = int(plan.lane[i - 1]), int(plan.lane[i])
        line = int(lanes.stop_line[before])
        if line < 0 or after in (lanes.left[before], lanes.right[before]):
            continue
        signal = int(signals.stop_signal[line])
        if signals.kind[signal] == SignalKind.YIELD:
            continue
        to_line_m = float(lanes.length_m[before] - plan.lane_m[i - 1])
        at_m = float(plan.route_m[i - 1]) + max(to_line_m, 0.0) - driver.nose_m
        is_light = signals.kind[signal] == SignalKind.LIGHT
        found.append(StopPoint(route_m=at_m, light=signal if is_light else -1))
    return found


def speed_profile(
    plan: RoutePlan, limit_mps: Float64, driver: PerfectDriver
) -> tuple[Float64, Float64]:
    """The speed allowed along the route by limits, curves and braking for both.

    Args:
        plan: The route.
        limit_mps: (R,) speed limit at each route point.
        driver: Its limits.

    Returns:
        (R,) route metres, strictly ascending, and (R,) speed allowed there [m/s].
    """
    keep = np.concatenate([[True], np.diff(plan.route_m) > 1e-6])
    route_m, yaw = plan.route_m[keep], np.unwrap(plan.points[keep, 3])
    allowed = np.minimum(limit_mps[keep], np.sqrt(driver.lateral_mps2 / _bend(route_m, yaw)))
    for i in range(len(route_m) - 2, -1, -1):
        step_m = route_m[i + 1] - route_m[i]
        braked = math.sqrt(allowed[i + 1] ** 2 + 2.0 * driver.braking_mps2 * step_m)
        allowed[i] = min(allowed[i], braked)
    return route_m, allowed


def _bend(route_m: Float64, yaw: Float64) -> Float64:
    """Curvature [1/m] over `CURVE_SPAN_M` around each point, never quite 0."""
    half = CURVE_SPAN_M / 2.0
    ahead = np.interp(route_m + half, route_m, yaw)
    behind = np.interp(route_m - half, route_m, yaw)
    return np.maximum(np.abs(ahead - behind) / CURVE_SPAN_M, 1e-6)


class SpeedsAhead:
    """The speed profile, read in ascending order without a search."""

    def __init__(self, profile: tuple[Float64, Float64]) -> None:
        self._route_m: list[Any] = profile[0].tolist()
        self._allowed: list[Any] = profile[1].tolist()
        self._index = 0

    def allowed(self, done_m: float) -> float:
        self._index = self._after(done_m, self._index)
        return self._allowed_at(self._index)

    def beyond_s(self, ahead_m: float, done_m: float, speed: float, gain_mps2: float) -> float:
        """Time to go `ahead_m` from a place and a speed, as fast as the profile lets it."""
        seconds, goal_m, index = 0.0, done_m + ahead_m, self._index
        while done_m < goal_m and seconds < LONGEST_YELLOW_S:
            index = self._after(done_m, index)
            faster = min(speed + gain_mps2 * TICK_S, max(self._allowed_at(index), 0.1))
            done_m += 0.5 * (speed + faster) * TICK_S
            speed, seconds = faster, seconds + TICK_S
        return seconds

    def _after(self, done_m: float, index: int) -> int:
        last = len(self._route_m) - 1
        while index < last and self._route_m[index + 1] <= done_m:
            index += 1
        return index

    def _allowed_at(self, index: int) -> float:
        return float(self._allowed[min(index + 1, len(self._allowed) - 1)])
