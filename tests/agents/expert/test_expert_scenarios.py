"""The expert where the Leaderboard's scenarios are: people who step out, lights that turn on it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from agents.expert.agent import Expert
from agents.expert.base_line import STEP_M
from agents.expert.config import ExpertConfig
from agents.expert.hiding import SLOWEST_MPS
from agents.expert.path import build_path
from agents.expert.people import WARY_MPS, WARY_MPS2
from agents.expert.target_speed import stopping_speed
from agents.expert.visible import Visible
from di_envs.suites import choose_suite
from di_envs.town.lanes import LaneKind
from di_envs.town.loading import load_town
from di_envs.town.plan import RoutePlan
from di_envs.town.queries import nearest_lane
from di_envs.town.town import Town
from di_envs.world.state import TICK_S, ActorKind, EventKind
from di_envs.world.world import Event, World, WorldConfig
from tests.agents.expert.straight_road import (
    HALF_M,
    LIMIT_MPS,
    Drive,
    make_actors,
    make_path,
)


def beside_the_road(kind: ActorKind, *, at_m: float, right_m: float = 6.0) -> Visible:
    """Somebody who stands to the right of the path and faces it."""
    actors = make_actors(1)
    actors.kind[1] = kind
    actors.x[1], actors.y[1], actors.yaw[1] = at_m, right_m, -math.pi / 2.0
    actors.half_length[1] = actors.half_width[1] = 0.25
    return actors


@pytest.mark.parametrize("kind", [ActorKind.WALKER, ActorKind.BICYCLE])
def test_past_somebody_who_may_step_out_it_drives_so_that_it_could_still_stop(kind: ActorKind):
    actors = beside_the_road(kind, at_m=150.0)
    drive = Drive(make_path(), actors)
    while drive.front < 149.0:
        drive.run(0.1)
        room = 150.0 - 0.25 - 2.5 - drive.front
        if room > 0.5:
            assert drive.speed <= max(math.sqrt(2.0 * WARY_MPS2 * room), WARY_MPS) + 0.3
    assert drive.speed < WARY_MPS + 0.3
    drive.run(5.0)
    assert drive.speed > 10.0  # he never stepped out


def test_whoever_waits_at_a_crosswalk_or_turns_away_does_not_slow_it_down():
    for crosswalks, yaw in (((148.0,), -math.pi / 2.0), ((), math.pi / 2.0), ((), 0.0)):
        actors = beside_the_road(ActorKind.WALKER, at_m=150.0)
        actors.yaw[1] = yaw
        drive = Drive(make_path(crosswalks=crosswalks), actors)
        while drive.front < 160.0:
            drive.run(0.5)
        assert drive.speed == pytest.approx(LIMIT_MPS, abs=0.1)


@pytest.mark.parametrize(("height_m", "slows"), [(2.6, True), (1.4, False)])
def test_past_a_standing_vehicle_that_hides_people_it_drives_slowly(height_m: float, slows: bool):
    """It stands 1.4 m beside the car: who runs out at 4 m/s is there after 0.35 s."""
    actors = make_actors(1)
    actors.x[1], actors.y[1], actors.height[1] = 150.0, 3.5, height_m
    drive = Drive(make_path(), actors)
    slowest = LIMIT_MPS
    while drive.front < 160.0:
        drive.step()
        if drive.front > 140.0:
            slowest = min(slowest, drive.speed)
    assert (slowest < SLOWEST_MPS + 0.3) == slows
    assert slows or slowest == pytest.approx(LIMIT_MPS, abs=0.1)


def test_it_passes_a_hiding_place_so_far_aside_that_nobody_could_be_there_in_time():
    actors = make_actors(1)
    actors.x[1], actors.y[1], actors.height[1] = 150.0, 10.0, 2.6
    drive = Drive(make_path(), actors)
    drive.place(100.0, LIMIT_MPS)
    while drive.front < 160.0:
        drive.step()
        assert drive.speed > 12.0


def test_who_runs_out_when_it_cannot_stop_any_more_is_passed_if_it_is_past_before_him():
    """At 14 m/s it needs 12 m; he is 10 m before it, and a second aside."""
    actors = beside_the_road(ActorKind.WALKER, at_m=100.0 + HALF_M + 10.0, right_m=5.6)
    actors.speed[1] = 4.2
    drive = Drive(make_path(), actors)
    drive.place(100.0, LIMIT_MPS)
    drive.step()
    assert drive.control[2] == 0.0


def test_it_brakes_for_a_cyclist_who_will_be_on_its_path_and_not_for_one_who_will_have_left_it():
    for speed, slows in ((1.5, True), (10.0, False)):
        actors = beside_the_road(ActorKind.BICYCLE, at_m=60.0, right_m=5.0)
        actors.speed[1] = speed
        drive = Drive(make_path(), actors)
        drive.place(40.0, 10.0)
        drive.step()
        assert (drive.control[2] > 0.0) == slows


@pytest.fixture(scope="module")
def toy() -> tuple[Town, tuple[RoutePlan, ...]]:
    suite = choose_suite("toy", scenarios="toy")
    town = load_town(suite.town_path)
    return town, suite.plans(town)


def test_who_is_told_is_slow_where_somebody_will_step_out_and_nowhere_else(
    toy: tuple[Town, tuple[RoutePlan, ...]],
):
    town, plans = toy
    config = ExpertConfig()
    plan = next(plan for plan in plans if any(t.type == 3 for t in plan.scenarios))
    trigger = next(trigger for trigger in plan.scenarios if trigger.type == 3)
    path = build_path(plan, town, config, told=True)
    x, y = plan.points[trigger.point, :2]
    there = int(np.argmin((path.x - x) ** 2 + (path.y - y) ** 2))
    assert path.speed_mps[there : there + int(15.0 / STEP_M)].max() == config.wary_mps
    assert path.speed_mps.max() > config.wary_mps


def test_who_is_not_told_drives_the_same_path_wherever_somebody_will_step_out(
    toy: tuple[Town, tuple[RoutePlan, ...]],
):
    town, plans = toy
    for plan in plans:
        untold = dataclasses.replace(plan, scenarios=())
        a, b = (build_path(p, town, ExpertConfig()) for p in (plan, untold))
        assert all(np.array_equal(*columns) for columns in zip(a, b, strict=True))


def test_beside_a_walkway_it_stops_within_what_it_can_count_on_seeing():
    """With 5 m/s2 after 0.2 s: v x 0.2 + v^2 / 10 = 10 m gives 9.05 m/s."""
    speed = stopping_speed(10.0)
    assert speed == pytest.approx(9.05, abs=0.01)
    assert 0.2 * speed + speed**2 / 10.0 == pytest.approx(10.0)


def test_only_the_lane_next_to_a_walkway_is_driven_slowly():
    suite = choose_suite("town05_long")
    town, config = load_town(suite.town_path), ExpertConfig()
    slow = stopping_speed(config.kerb_sight_m)
    for plan in suite.plans(town)[:3]:
        path = build_path(plan, town, config)
        assert path.speed_mps.max() > slow  # on the second lane from the kerb
        for i in range(0, path.x.size, 20):
            place = float(path.x[i]), float(path.y[i]), float(path.z[i])
            found = nearest_lane(town.lanes, *place, 6.0, 1 << int(LaneKind.SIDEWALK))
            if found.lane >= 0 and found.distance_m < 3.0:
                assert path.speed_mps[i] <= slow + 1e-9


def drive(world: World, plan: RoutePlan, seed: int) -> list[Event]:
    world.reset(seed, [plan])
    agent = Expert()
    memory, events = agent.start(plan, seed), []
    while not world.view.state.finished[0]:
        control, memory = agent.act({"world": world.view}, memory)
        events += world.advance(control[None].astype(np.float64), round(0.1 / TICK_S))
    return events


def test_it_completes_toy_routes_with_scenarios_without_an_infraction(
    toy: tuple[Town, tuple[RoutePlan, ...]],
):
    town, plans = toy
    world = World(town, WorldConfig(vehicles=8, walkers=6))
    begun = set()
    for plan in plans:
        events = drive(world, plan, seed=1)
        kinds = {event.kind for event in events}
        assert kinds <= {EventKind.COMPLETED, EventKind.SCENARIO, EventKind.MIN_SPEED}
        begun |= {int(event.value) for event in events if event.kind is EventKind.SCENARIO}
    assert begun == {1, 3, 4, 7, 9, 10}
