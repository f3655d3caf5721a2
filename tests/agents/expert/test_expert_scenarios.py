"""The expert where the Leaderboard's scenarios are: people who step out, lights that turn on it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from agents.expert.surroundings import Actors, Lights

from agents.expert.agent import Expert
from agents.expert.base_line import STEP_M
from agents.expert.config import ExpertConfig
from agents.expert.path import build_path
from agents.expert.people import WARY_MPS, WARY_MPS2
from di_envs.suites import choose_suite
from di_envs.town.lanes import LightState
from di_envs.town.loading import load_town
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.lights import GREEN_TICKS, YELLOW_TICKS
from di_envs.world.state import TICK_S, ActorKind, EventKind
from di_envs.world.world import Event, World, WorldConfig
from tests.agents.expert.straight_road import (
    HALF_M,
    LIMIT_MPS,
    Drive,
    make_actors,
    make_lights,
    make_path,
)


def beside_the_road(kind: ActorKind, *, at_m: float, right_m: float = 6.0) -> Actors:
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


def test_whoever_walks_a_walkway_or_turns_away_does_not_slow_it_down():
    for walk_edge, yaw in ((3, -math.pi / 2.0), (-1, math.pi / 2.0), (-1, 0.0)):
        actors = beside_the_road(ActorKind.WALKER, at_m=150.0)
        actors.walk_edge[1], actors.yaw[1] = walk_edge, yaw
        drive = Drive(make_path(), actors)
        while drive.front < 160.0:
            drive.run(0.5)
        assert drive.speed == pytest.approx(LIMIT_MPS, abs=0.1)


def test_it_brakes_for_a_cyclist_who_will_be_on_its_path_and_not_for_one_who_will_have_left_it():
    for speed, slows in ((1.5, True), (10.0, False)):
        actors = beside_the_road(ActorKind.BICYCLE, at_m=60.0, right_m=5.0)
        actors.speed[1] = speed
        drive = Drive(make_path(), actors)
        drive.place(40.0, 10.0)
        drive.step()
        assert (drive.control[2] > 0.0) == slows


def held_green() -> Lights:
    """A light that a scenario holds at green: by its turn it would last for ever."""
    return make_lights(LightState.GREEN, ticks=-100_000)


def play_with_the_light(drive: Drive, line_m: float, limit_s: float) -> None:
    """Scenarios 7 to 9: green until the car is 10 m before the line, 2 s of yellow, red."""
    left_s = 2.0
    for _ in range(round(limit_s / 0.1)):
        if line_m - drive.x < 10.0:
            left_s -= 0.1
            state = LightState.YELLOW if left_s > 0.0 else LightState.RED
            ticks = GREEN_TICKS + YELLOW_TICKS - round(left_s / TICK_S)
            drive.lights = make_lights(state, ticks=ticks)
        drive.step()
        if left_s <= 0.0:
            return


@pytest.mark.parametrize("speed", [3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0])
def test_when_green_turns_to_a_short_yellow_before_it_no_speed_leads_onto_the_line_at_red(
    speed: float,
):
    """The tail is over the line 10 + 2.45 + 1 m after the yellow began: below 6.7 m/s it stops."""
    drive = Drive(make_path(line_m=150.0, limit_mps=speed), make_actors(), lights=held_green())
    drive.place(60.0, speed)
    play_with_the_light(drive, 150.0, limit_s=60.0)
    passed = drive.x - HALF_M - 1.0 > 150.0
    assert passed or drive.front < 150.0
    assert passed == (speed > 8.0)


def test_a_green_that_lasts_once_it_stands_at_the_line_lets_it_go():
    drive = Drive(make_path(line_m=100.0), make_actors(), lights=held_green())
    drive.place(100.0 - HALF_M - 0.7, 0.0)
    drive.run(3.0)
    assert drive.front > 105.0


@pytest.fixture(scope="module")
def toy() -> tuple[Town, tuple[RoutePlan, ...]]:
    suite = choose_suite("toy", scenarios="toy")
    town = load_town(suite.town_path)
    return town, suite.plans(town)


def test_the_path_is_slow_where_the_plan_says_that_somebody_hides(
    toy: tuple[Town, tuple[RoutePlan, ...]],
):
    town, plans = toy
    config = ExpertConfig()
    plan = next(plan for plan in plans if any(t.type == 3 for t in plan.scenarios))
    trigger = next(trigger for trigger in plan.scenarios if trigger.type == 3)
    path = build_path(plan, town, config)
    x, y = plan.points[trigger.point, :2]
    there = int(np.argmin((path.x - x) ** 2 + (path.y - y) ** 2))
    assert path.speed_mps[there : there + int(15.0 / STEP_M)].max() == config.wary_mps
    assert path.speed_mps.max() > config.wary_mps


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
