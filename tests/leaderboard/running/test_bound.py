"""The perfect driver's times, by the arithmetic of a point mass on a street of two lanes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from di_envs.town.lanes import Crosswalks, Lanes, LightState, SignalKind, Signals
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.lights import GREEN_TICKS, TURN_TICKS, YELLOW_TICKS
from di_envs.world.state import TICK_S
from leaderboard.running.bound import light_limited_bound
from leaderboard.running.perfect_driver import PerfectDriver, speed_profile, stop_points
from leaderboard.running.quiet_world import QuietWorld

LIMIT_MPS = 12.0
NOSE_M = PerfectDriver().nose_m


def _lanes(**arrays: Any) -> Lanes:
    """Lanes of which this test needs but a few arrays; the rest are empty."""
    return Lanes(**{name: arrays.get(name, np.zeros(0)) for name in Lanes._fields})


def _signals(kind: SignalKind, groups: int) -> Signals:
    """One signal head at one junction, for the stop line 0."""
    light = kind == SignalKind.LIGHT
    return Signals(
        kind=np.array([kind], dtype=np.int8),
        junction=np.zeros(1, dtype=np.int32),
        group=np.array([0 if light else -1], dtype=np.int32),
        pose=np.zeros((1, 4)),
        box=np.zeros((1, 6)),
        stop_signal=np.zeros(1, dtype=np.int32),
        stop_lane=np.zeros(1, dtype=np.int32),
        stop_pose=np.zeros((1, 4)),
        stop_width_m=np.zeros(1),
        groups=np.array([groups if light else 0], dtype=np.int32),
    )


def street(approach_m: float, beyond_m: float, signal: SignalKind, groups: int = 4) -> Town:
    """Lane 0 of `approach_m` ends at a stop line; lane 1 goes on for `beyond_m`."""
    return Town(
        name="street",
        lanes=_lanes(
            length_m=np.array([approach_m, beyond_m]),
            speed_limit_mps=np.array([LIMIT_MPS, LIMIT_MPS]),
            stop_line=np.array([0, -1], dtype=np.int32),
            left=np.array([-1, -1], dtype=np.int32),
            right=np.array([-1, -1], dtype=np.int32),
        ),
        signals=_signals(signal, groups),
        crosswalks=Crosswalks(*(np.zeros(0) for _ in Crosswalks._fields)),
        road_names=("0",),
        junction_names=("0",),
        geo_origin=(0.0, 0.0),
        content_hash="",
        opendrive="",
    )


def straight(approach_m: int, beyond_m: int, yaw: Any = 0.0) -> RoutePlan:
    """A plan over both lanes, a point a metre."""
    count = approach_m + beyond_m + 1
    at_m = np.arange(count, dtype=float)
    points = np.zeros((count, 4))
    points[:, 0], points[:, 3] = at_m, yaw
    beyond = at_m >= approach_m
    return RoutePlan(
        route_id="0",
        town="street",
        keypoints=points[[0, -1], :3],
        points=points,
        option=np.full(count, 4, dtype=np.int8),
        lane=beyond.astype(np.int32),
        lane_m=np.where(beyond, at_m - approach_m, at_m),
        route_m=at_m,
        targets=np.array([count - 1]),
    )


def first_green_s(town: Town, seed: int, not_before_s: float) -> float:
    """When the light is next green, by looking at it tick by tick."""
    shown = shown_lights(town, seed, 10000)
    first = next(
        tick
        for tick, colour in enumerate(shown)
        if tick * TICK_S >= not_before_s and colour == LightState.GREEN
    )
    return first * TICK_S


def shown_lights(town: Town, seed: int, ticks: int) -> list[int]:
    """What the first light shows, tick by tick."""
    world, shown = QuietWorld(town, straight(50, 50), seed), []
    for _ in range(ticks):
        shown.append(int(world.light[0]))
        world.advance(0.0)
    return shown


def free_time_s(distance_m: float) -> float:
    """Time from standstill over a distance with 3 m/s² up to the limit."""
    ramp_m = LIMIT_MPS**2 / 6.0
    return LIMIT_MPS / 3.0 + (distance_m - ramp_m) / LIMIT_MPS


def test_an_open_street_takes_four_seconds_to_speed_up_and_the_rest_at_the_limit():
    bound = light_limited_bound(street(100, 100, SignalKind.YIELD), straight(100, 100), 0)
    assert bound.route_completion == 100.0
    assert bound.finish_s == pytest.approx(free_time_s(198.0), abs=0.15)
    assert bound.stopped_s < 0.1


def test_a_stop_sign_costs_braking_and_starting_but_no_waiting():
    bound = light_limited_bound(street(100, 100, SignalKind.STOP), straight(100, 100), 0)
    ramp_m = LIMIT_MPS**2 / 6.0
    before_s = 2 * LIMIT_MPS / 3.0 + (100.0 - NOSE_M - 2 * ramp_m) / LIMIT_MPS
    assert bound.finish_s == pytest.approx(before_s + free_time_s(98.0 + NOSE_M), abs=0.4)
    assert bound.stopped_s < 0.5


def test_the_perfect_driver_waits_for_green_and_no_longer():
    town, plan = street(100, 100, SignalKind.LIGHT), straight(100, 100)
    for seed in range(6):
        bound = light_limited_bound(town, plan, seed)
        if bound.stopped_s > 1.0:
            green_s = first_green_s(town, seed, 2 * LIMIT_MPS / 3.0)
            expected_s = green_s + free_time_s(98.0 + NOSE_M)
            assert bound.finish_s == pytest.approx(expected_s, abs=0.3)
        else:
            assert bound.finish_s == pytest.approx(free_time_s(198.0), abs=4.5)


def test_a_light_that_stays_red_beyond_the_timeout_bounds_the_score():
    town, plan = street(20, 20, SignalKind.LIGHT, groups=8), straight(20, 20)  # 37 s allowed
    bounds = [light_limited_bound(town, plan, seed) for seed in range(16)]
    stuck = [bound for bound in bounds if bound.finish_s is None]
    assert stuck
    for bound in stuck:
        assert bound.route_completion == pytest.approx(100 * (20 - NOSE_M) / 40, abs=0.5)


def test_lights_show_green_ten_yellow_three_and_red_for_the_rest_of_the_round():
    town = street(10, 10, SignalKind.LIGHT, groups=3)
    shown = shown_lights(town, 5, 3 * TURN_TICKS)
    assert shown.count(LightState.GREEN) == GREEN_TICKS
    assert shown.count(LightState.YELLOW) == YELLOW_TICKS
    assert shown.count(LightState.RED) == 3 * TURN_TICKS - GREEN_TICKS - YELLOW_TICKS


def test_a_curve_of_twelve_metres_radius_is_taken_at_six_metres_per_second():
    yaw = np.clip((np.arange(201) - 80.0) / 12.0, 0.0, math.pi / 2)
    driver = PerfectDriver()
    _, allowed = speed_profile(straight(100, 100, yaw), np.full(201, LIMIT_MPS), driver)
    assert allowed[85] == pytest.approx(math.sqrt(3.0 * 12.0))
    assert allowed[40] == LIMIT_MPS
    # fully in the bend at 82 m: six metres before it, braking by 3 m/s² allows √(36 + 2·3·6) m/s
    assert allowed[82 - 6] == pytest.approx(math.sqrt(72.0))


def test_stop_points_are_a_car_nose_before_the_line_and_only_where_the_lane_ends():
    found = stop_points(street(50, 50, SignalKind.STOP), straight(50, 50), PerfectDriver())
    assert [(stop.route_m, stop.light) for stop in found] == [(pytest.approx(50 - NOSE_M), -1)]
    changed = street(50, 50, SignalKind.STOP)
    beside = changed.lanes._replace(left=np.array([1, -1], dtype=np.int32))
    town = Town(**{**vars(changed), "lanes": beside})
    assert stop_points(town, straight(50, 50), PerfectDriver()) == []


def test_the_same_seed_gives_the_same_bound():
    town, plan = street(60, 60, SignalKind.LIGHT), straight(60, 60)
    assert light_limited_bound(town, plan, 7) == light_limited_bound(town, plan, 7)
