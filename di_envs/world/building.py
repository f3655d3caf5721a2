"""What a world is built of: tables of its town, arguments of its kernels, and its first moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.town.kept import kept
from di_envs.town.lanes import Lanes
from di_envs.town.once import once_a_town
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.dynamics import EgoModel, EgoParameters, locate_ego
from di_envs.world.events.watching import begin_events
from di_envs.world.lights import start_lights
from di_envs.world.poles import place_poles
from di_envs.world.scenarios.tables import ScenarioTables, actors_needed
from di_envs.world.state import OCCUPIED_LANES, ActorKind, Capacity, Routes, State
from di_envs.world.step import Scenery, Scratch
from di_envs.world.traffic.approach import make_requests
from di_envs.world.traffic.occupancy import make_occupancy
from di_envs.world.traffic.spawn import Spots, find_spots, spawn_traffic
from di_envs.world.traffic.speed_choice import make_leaders
from di_envs.world.traffic.tables import TrafficTables, traffic_tables
from di_envs.world.walkers.neighbours import make_neighbours
from di_envs.world.walkers.spawn import spawn_walkers
from di_envs.world.walkers.walk_graph import WalkGraph, build_walk_graph

# Fields of which 0 would mean something: a fresh record gets -1 there, for none
NONE_AT_FIRST = (
    *("lane", "path", "previous_lane", "earlier_lanes", "changing_from", "grant"),
    *("stopped_at", "arrival_tick", "walk_edge", "occupied"),
)


@dataclass(frozen=True, kw_only=True)
class TownTables:
    """What takes a while to work out of a town, shared by all worlds in it."""

    traffic: TrafficTables
    walk: WalkGraph
    spots: Spots
    ego_model: EgoParameters


@once_a_town
@kept
def town_tables(town: Town) -> TownTables:
    """The tables of a town."""
    traffic = traffic_tables(town)
    return TownTables(
        traffic=traffic,
        spots=find_spots(town.lanes, traffic),
        walk=build_walk_graph(town),
        ego_model=EgoModel().parameters(),
    )


def capacity_for(town: Town, plans: tuple[RoutePlan, ...], vehicles: int, walkers: int) -> Capacity:
    """How many there are of each, with an ego for each plan."""
    return Capacity(
        egos=len(plans),
        vehicles=vehicles,
        walkers=walkers,
        props=town.signals.kind.size,
        junctions=town.signals.groups.size,
        signals=town.signals.kind.size,
        triggers=sum(len(plan.scenarios) for plan in plans),
        scenario_actors=actors_needed(plans),
    )


def build_scenery(
    town: Town, tables: TownTables, plans: tuple[RoutePlan, ...], scenarios: ScenarioTables
) -> Scenery:
    """What kernels read of a town and of the plans."""
    return Scenery(
        lanes=town.lanes,
        signals=town.signals,
        crosswalks=town.crosswalks,
        tables=tables.traffic,
        walk=tables.walk,
        routes=route_arrays(plans),
        scenarios=scenarios,
        ego_model=tables.ego_model,
    )


def make_scratch(town: Town, capacity: Capacity) -> Scratch:
    """Allocates the working memory of a tick."""
    actors = capacity.actors
    return Scratch(
        occupancy=make_occupancy(town.lanes.kind.size, actors, capacity.egos),
        requests=make_requests(actors),
        leaders=make_leaders(actors),
        neighbours=make_neighbours(actors, town.lanes.kind.size),
        busy=np.zeros(town.crosswalks.width_m.size, np.int8),
        acceleration=np.zeros(actors),
        cap=np.zeros(actors),
        below=np.full(OCCUPIED_LANES, -1, np.int32),
    )


def route_arrays(plans: Sequence[RoutePlan]) -> Routes:
    """The plans one after the other, as kernels read them."""

    def join(parts: list[NDArray[Any]], empty: tuple[int, ...], dtype: str) -> NDArray[Any]:
        return np.concatenate([np.zeros(empty), *parts]).astype(dtype)

    return Routes(
        start=np.cumsum([0] + [plan.points.shape[0] for plan in plans]).astype(np.int32),
        points=join([plan.points for plan in plans], (0, 4), "f8"),
        option=join([plan.option for plan in plans], (0,), "i1"),
        lane=join([plan.lane for plan in plans], (0,), "i4"),
        lane_m=join([plan.lane_m for plan in plans], (0,), "f8"),
        route_m=join([plan.route_m for plan in plans], (0,), "f8"),
        target_start=np.cumsum([0] + [plan.targets.size for plan in plans]).astype(np.int32),
        target=join([plan.targets for plan in plans], (0,), "i4"),
        timeout_s=np.array([plan.timeout_s for plan in plans], "f8"),
    )


def begin_episode(
    state: State,
    seed: int,
    scenery: Scenery,
    spots: Spots,
    capacity: Capacity,
    plans: tuple[RoutePlan, ...],
) -> None:
    """Fills a fresh state: lights, egos at their routes' starts, traffic and walkers, poles.

    Args:
        state: All zeros; filled.
        seed: Of all draws.
        scenery: What the world stands on.
        spots: Where vehicles may stand at first.
        capacity: How many there are of each.
        plans: One an ego.
    """
    state.seed[...] = seed
    for name in NONE_AT_FIRST:
        getattr(state, name)[...] = -1
    lanes, signals = scenery.lanes, scenery.signals
    start_lights(state, signals)
    for ego, plan in enumerate(plans):
        _place_ego(state, lanes, ego, plan)
    spawn_traffic(state, lanes, scenery.tables, spots, plans, capacity.egos, capacity.vehicles)
    spawn_walkers(state, scenery.walk, capacity.vehicle_end, capacity.walkers)
    place_poles(state, signals, capacity.walker_end)


def _place_ego(state: State, lanes: Lanes, ego: int, plan: RoutePlan) -> None:
    model = EgoModel()
    state.kind[ego] = ActorKind.CAR
    state.half_length[ego] = model.half_length_m
    state.half_width[ego] = model.half_width_m
    state.height[ego] = model.height_m
    state.x[ego], state.y[ego], state.z[ego], state.yaw[ego] = plan.points[0]
    begin_events(state, ego)
    locate_ego(state, lanes, ego)
