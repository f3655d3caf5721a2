"""The expert among traffic on rings whose two junctions are joined by long and by tiny roads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from agents.expert.agent import Expert
from di_envs.town.loading import load_town
from di_envs.town.routing.road_graph import build_road_graph
from di_envs.town.routing.router import plan_route
from di_envs.town.routing.routes import read_routes
from di_envs.world.state import EventKind
from di_envs.world.world import World, WorldConfig

CASES = Path(__file__).resolve().parents[2] / "data" / "cases"


@pytest.mark.parametrize("name", ["ring1", "ring2", "ring3"])
def test_it_completes_a_ring_of_two_junctions_however_near_they_are(name: str) -> None:
    """On ring2, roads of 1.1 and 2.3 m: nobody may wait there, nor keep a grant left behind."""
    town = load_town(CASES / f"{name}.xodr", signals="none")
    (route,) = read_routes(CASES / f"{name}.xml")
    graph = build_road_graph(town)
    plan = plan_route(town, route.positions, route_id=route.route_id, graph=graph)
    world, agent, longest = World(town, WorldConfig(vehicles=3, walkers=0)), Expert(), 0
    world.reset(0, [plan])
    memory, kinds = agent.start(plan, 0), []
    state = world.view.state
    while not state.finished[0] and state.tick < 6000:
        control, memory = agent.act({"world": world.view}, memory)
        kinds += [event.kind for event in world.advance(control[None].astype(np.float64), 2)]
        longest = max(longest, int(state.still_ticks[:4].max()))
    assert EventKind.COMPLETED in kinds
    assert EventKind.COLLISION_VEHICLE not in kinds
    assert longest < 20 * 60
