"""The light-limited bound: what a perfect driver gets on a route under the timeout rule.

On a short route a red light or two can eat the whole time allowed, so that nobody can score 100.
Tables print this bound beside an agent's score to tell the two apart. The driver is a point mass on
the route at the speed limit, held back by curves, stop signs and the world's own lights for the
seed, with nobody else on the road; it commits no infraction, so its DS is its RC.

It goes through yellow where its tail is over the line before red, as the rules let it. Scenarios 7
to 9 change the lights by where it is; nobody gains by coming later, as every step of theirs begins
once the ego is near enough. Those who cross in scenarios 3 and 4 do not hold it back.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import LightState
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.state import TICK_S
from leaderboard.records.record import Bound
from leaderboard.running.perfect_driver import (
    PerfectDriver,
    SpeedsAhead,
    StopPoint,
    speed_profile,
    stop_points,
)
from leaderboard.running.quiet_world import QuietWorld

Float64 = NDArray[np.float64]

# Leaderboard 1.0: a route is completed beyond 99 % of it and within 10 m of its last point
COMPLETE_SHARE = 0.99
COMPLETE_WITHIN_M = 10.0


def light_limited_bound(
    town: Town, plan: RoutePlan, world_seed: int, driver: PerfectDriver | None = None
) -> Bound:
    """Drives the route as `PerfectDriver` from standstill and says how far it gets in time."""
    driver = driver or PerfectDriver()
    route_m, allowed = speed_profile(plan, town.lanes.speed_limit_mps[plan.lane], driver)
    stops = stop_points(town, plan, driver)
    return _drive(plan, (route_m, allowed), stops, QuietWorld(town, plan, world_seed), driver)


def _drive(
    plan: RoutePlan,
    profile: tuple[Float64, Float64],
    stops: list[StopPoint],
    world: QuietWorld,
    driver: PerfectDriver,
) -> Bound:
    """Advances the point mass tick by tick until the route is completed or times out."""
    length_m = plan.length_m
    goal_m = max(COMPLETE_SHARE * length_m, length_m - COMPLETE_WITHIN_M)
    done_m, speed, ahead, stood = 0.0, 0.0, 0, 0
    table = SpeedsAhead(profile)
    for tick in range(round(plan.timeout_s / TICK_S) + 1):  # the world ends it once it is over
        while ahead < len(stops) and done_m > stops[ahead].route_m + 0.5:
            ahead += 1
        target = min(speed + driver.acceleration_mps2 * TICK_S, table.allowed(done_m))
        if ahead < len(stops):
            gap_m = stops[ahead].route_m - done_m
            if stops[ahead].light < 0 and gap_m < 0.2 and speed < 0.1:
                ahead += 1  # stopped for the sign: one tick is enough
            elif _must_stop(stops[ahead], gap_m, speed, world, table, driver):
                target = min(target, _speed_before(gap_m, driver))
        target = max(target, speed - 2.0 * driver.braking_mps2 * TICK_S, 0.0)
        done_m += 0.5 * (speed + target) * TICK_S
        speed = target
        world.advance(done_m)
        stood += speed < 0.1
        if done_m > goal_m:
            finish_s = (tick + 1) * TICK_S
            return Bound(route_completion=100.0, finish_s=finish_s, stopped_s=stood * TICK_S)
    completion = 100.0 * min(done_m / length_m, 1.0)
    return Bound(route_completion=completion, finish_s=None, stopped_s=stood * TICK_S)


def _must_stop(
    stop: StopPoint,
    gap_m: float,
    speed: float,
    world: QuietWorld,
    table: SpeedsAhead,
    driver: PerfectDriver,
) -> bool:
    """Whether to stop there: at signs always, at red, and at yellow that is too short."""
    if stop.light < 0:
        return True
    colour = world.light[stop.light]
    if colour in (LightState.GREEN, LightState.NONE):
        return False
    if speed * speed / (2.0 * driver.braking_mps2) > gap_m + 0.5:
        return False  # too late to brake
    if colour == LightState.RED:
        return True
    over_m = gap_m + driver.nose_m + driver.tail_m
    over_s = table.beyond_s(over_m, stop.route_m - gap_m, speed, driver.acceleration_mps2)
    return over_s > world.yellow_left_s(stop.light)


def _speed_before(gap_m: float, driver: PerfectDriver) -> float:
    """The highest speed from which the driver still stops within `gap_m`."""
    return math.sqrt(2.0 * driver.braking_mps2 * max(gap_m, 0.0))
