"""The world in which the bound is driven: scenarios play with its lights by where the ego is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from di_envs.suites import choose_suite
from di_envs.town.lanes import LightState
from di_envs.town.loading import load_town
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.state import TICK_S
from leaderboard.running.bound import light_limited_bound
from leaderboard.running.perfect_driver import PerfectDriver, stop_points
from leaderboard.running.quiet_world import QuietWorld

SEED = 4


@pytest.fixture(scope="module")
def crossing() -> tuple[Town, RoutePlan]:
    """A toy route straight over lights, with scenario 7 before them."""
    suite = choose_suite("toy", scenarios="toy")
    town = load_town(suite.town_path)
    plans = suite.plans(town)
    return town, next(p for p in plans if any(t.subtype == "S7opposite" for t in p.scenarios))


def test_scenario_seven_shows_green_until_ten_metres_then_yellow_red_and_green(
    crossing: tuple[Town, RoutePlan],
):
    town, plan = crossing
    (stop,) = stop_points(town, plan, PerfectDriver())
    line_m = stop.route_m + PerfectDriver().nose_m
    world = QuietWorld(town, plan, SEED)
    trigger_m = float(plan.route_m[plan.scenarios[0].point])
    for done_m in np.arange(0.0, trigger_m + 1.0, 0.5):  # it looks a few route points ahead only
        world.advance(float(done_m))
    for _ in range(1000):
        world.advance(line_m - 10.6)
        assert world.light[stop.light] == LightState.GREEN
    shown = []
    for _ in range(1000):
        world.advance(line_m - 9.5)
        shown.append(int(world.light[stop.light]))
    changes = [i for i in range(1, 1000) if shown[i] != shown[i - 1]]
    assert [shown[0], *(shown[i] for i in changes)] == [
        LightState.GREEN,  # seen near at the end of a tick, shown in the next
        LightState.YELLOW,
        LightState.RED,
        LightState.GREEN,
    ]
    assert changes[1] - changes[0] == 40
    a, b = (town.signals.box[head, :3] for head in (stop.light, _other_green(world, stop.light)))
    red_s = 1.5 + 0.04 * float(np.linalg.norm(a - b))
    assert (changes[2] - changes[1]) * TICK_S == pytest.approx(red_s, abs=TICK_S)


def _other_green(world: QuietWorld, own: int) -> int:
    (other,) = [i for i in np.flatnonzero(world.light == LightState.GREEN).tolist() if i != own]
    return int(other)


def test_yellow_is_used_where_the_tail_is_over_the_line_before_red(
    crossing: tuple[Town, RoutePlan],
):
    """50 km/h over a straight crossing: 10 m and a car's length take less than 2 s."""
    town, plan = crossing
    bound = light_limited_bound(town, plan, SEED)
    assert bound.stopped_s < 0.2
    assert bound.finish_s is not None
    assert bound.finish_s < plan.length_m / 13.9 + 0.5 * 13.9 / 3.0 + 0.2


def test_without_scenarios_the_turns_of_the_lights_decide(crossing: tuple[Town, RoutePlan]):
    town, plan = crossing
    plain = dataclasses.replace(plan, scenarios=())
    waits = [light_limited_bound(town, plain, seed).stopped_s for seed in range(8)]
    held = [light_limited_bound(town, plan, seed).stopped_s for seed in range(8)]
    assert max(waits) > 5.0
    assert max(held) < 0.2
