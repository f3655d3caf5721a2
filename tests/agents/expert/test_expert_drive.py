"""The expert at the wheel, in the toy town's real world."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import di_envs
from agents.base import Agent
from agents.constant import ConstantAgent
from agents.expert.agent import Expert, ExpertMemory
from agents.expert.progress import localise
from agents.highway import HighwayAgent
from di_envs.town.loading import load_town
from di_envs.town.plan import RoutePlan
from di_envs.town.routing.road_graph import build_road_graph
from di_envs.town.routing.router import plan_route
from di_envs.town.routing.routes import read_routes
from di_envs.town.town import Town
from di_envs.world.state import TICK_S, EventKind
from di_envs.world.world import Event, World, WorldConfig

ROUTES = Path(di_envs.__file__).parent / "town" / "data" / "routes" / "toy.xml"


@pytest.fixture(scope="module")
def town() -> Town:
    return load_town("toy")


@pytest.fixture(scope="module")
def plans(town: Town) -> list[RoutePlan]:
    graph = build_road_graph(town)
    return [
        plan_route(town, route.positions, route_id=route.route_id, graph=graph)
        for route in read_routes(ROUTES)
    ]


def drive(
    world: World, agent: Agent, plan: RoutePlan, seed: int = 0, limit_s: float = 300.0
) -> tuple[list[Event], list[object]]:
    """Drives a route to its end; returns the events and the memories behind each decision."""
    world.reset(seed, [plan])
    memory, events, memories = agent.start(plan, seed), [], []
    ticks = round(agent.requires.control_dt_s / TICK_S)
    while not world.view.state.finished[0] and world.view.state.tick[()] * TICK_S < limit_s:
        control, memory = agent.act({"world": world.view}, memory)
        memories.append(memory)
        events += world.advance(control[None].astype(np.float64), ticks)
    return events, memories


def test_it_completes_every_toy_route_in_traffic_without_an_infraction(
    town: Town, plans: list[RoutePlan]
):
    world = World(town, WorldConfig(vehicles=8, walkers=6))
    for plan in plans:
        events, _ = drive(world, Expert(), plan)
        kinds = [event.kind for event in events if event.kind is not EventKind.MIN_SPEED]
        assert kinds == [EventKind.COMPLETED]  # how slow it was is measured, no infraction in 1.0


def test_in_turns_it_stays_within_thirty_centimetres_of_its_path(
    town: Town, plans: list[RoutePlan]
):
    world = World(town, WorldConfig(vehicles=0, walkers=0))
    for plan in plans:
        world.reset(0, [plan])
        agent, worst = Expert(), 0.0
        memory = agent.start(plan, 0)
        while not world.view.state.finished[0]:
            control, memory = agent.act({"world": world.view}, memory)
            state = world.view.state
            assert memory.path is not None
            assert memory.progress is not None
            offset = localise(memory.path, memory.progress, state.x[0], state.y[0])[1]
            worst = max(worst, abs(offset))
            world.advance(control[None].astype(np.float64), 2)
        assert worst < 0.3


def test_the_memory_is_a_value_and_an_episode_can_be_branched_with_it(
    town: Town, plans: list[RoutePlan]
):
    world, agent = World(town, WorldConfig(vehicles=8, walkers=6)), Expert()
    plan = plans[1]
    world.reset(3, [plan])
    memory = agent.start(plan, 3)

    def go_on(memory: ExpertMemory, decisions: int) -> tuple[ExpertMemory, list[bytes]]:
        controls = []
        for _ in range(decisions):
            control, memory = agent.act({"world": world.view}, memory)
            controls.append(control.tobytes())
            world.advance(control[None].astype(np.float64), 2)
        return memory, controls

    memory, _ = go_on(memory, 60)
    snapshot, progress = world.save(), memory.progress
    _, first = go_on(memory, 60)
    assert memory.progress == progress
    world.restore(snapshot)
    _, second = go_on(memory, 60)
    assert first == second


def test_another_agent_of_the_same_kind_continues_where_one_stopped(
    town: Town, plans: list[RoutePlan]
):
    world = World(town, WorldConfig(vehicles=4, walkers=0))
    world.reset(0, [plans[0]])
    memory = Expert().start(plans[0], 0)
    control, memory = Expert().act({"world": world.view}, memory)
    again, _ = Expert().act({"world": world.view}, Expert().start(plans[0], 0))
    assert control.tolist() == again.tolist()


def test_the_expert_looks_and_changes_nothing(town: Town, plans: list[RoutePlan]):
    world, agent = World(town, WorldConfig(vehicles=8, walkers=6)), Expert()
    world.reset(0, [plans[0]])
    before = world.save().record.tobytes()
    agent.act({"world": world.view}, agent.start(plans[0], 0))
    assert world.save().record.tobytes() == before


def test_highway_envs_driver_completes_a_route_on_an_empty_road(town: Town, plans: list[RoutePlan]):
    world = World(town, WorldConfig(vehicles=0, walkers=0))
    events, memories = drive(world, HighwayAgent(), plans[0])
    assert events[-1].kind is EventKind.COMPLETED
    again, others = drive(world, HighwayAgent(), plans[0])
    assert [event.tick for event in again] == [event.tick for event in events]
    assert [(m.leg, m.target, m.timer_s) for m in memories] == [  # type: ignore[attr-defined]
        (m.leg, m.target, m.timer_s)  # type: ignore[attr-defined]
        for m in others
    ]


def test_a_constant_agent_leaves_the_road(town: Town, plans: list[RoutePlan]):
    world = World(town, WorldConfig(vehicles=0, walkers=0))
    events, _ = drive(world, ConstantAgent(throttle=0.6), plans[1], limit_s=60.0)
    assert EventKind.COMPLETED not in [event.kind for event in events]
