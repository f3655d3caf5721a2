"""One tick of a world: the order in which everything moves."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.arrays import Float64
from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel, made_of
from di_envs.town.lanes import Crosswalks, Lanes, Signals
from di_envs.world.contact import resolve_contacts
from di_envs.world.dynamics import EgoParameters, locate_ego, move_ego
from di_envs.world.events.progress import advance_progress
from di_envs.world.events.watching import detect_events
from di_envs.world.lights import advance_lights
from di_envs.world.scenarios.staging import move_scenarios, occupy_crossings, watch_scenarios
from di_envs.world.scenarios.tables import ScenarioTables
from di_envs.world.state import ActorKind, Routes, State
from di_envs.world.struck import GRIP_MPS2, pass_shocks
from di_envs.world.traffic.approach import Requests, note_ego_arrival
from di_envs.world.traffic.lane_change import change_lanes
from di_envs.world.traffic.motion import move_vehicle, take_another_way
from di_envs.world.traffic.occupancy import Occupancy, fill_occupancy
from di_envs.world.traffic.returning import bring_back
from di_envs.world.traffic.right_of_way import update_grants
from di_envs.world.traffic.speed_choice import Leaders, choose_speed, find_leaders
from di_envs.world.traffic.tables import TrafficTables
from di_envs.world.walkers.neighbours import Neighbours
from di_envs.world.walkers.on_edges import mark_busy_crosswalks
from di_envs.world.walkers.strolling import move_walkers
from di_envs.world.walkers.walk_graph import WalkGraph

_ABSENT = int(ActorKind.ABSENT)


@by_reference
class Scenery(NamedTuple):
    """What does not change in an episode."""

    lanes: Lanes
    signals: Signals
    crosswalks: Crosswalks
    tables: TrafficTables
    walk: WalkGraph
    routes: Routes
    scenarios: ScenarioTables
    ego_model: EgoParameters


@by_reference
class Scratch(NamedTuple):
    """Working memory of a tick: nothing in it outlives the tick."""

    occupancy: Occupancy
    requests: Requests
    leaders: Leaders
    neighbours: Neighbours
    busy: NDArray[np.int8]  # (X,) crosswalks that somebody walks on
    acceleration: NDArray[np.float64]  # (A,)
    cap: NDArray[np.float64]  # (A,)
    below: NDArray[np.int32]  # (OCCUPIED_LANES,)


def _parts_of_advance(
    state: Any, scenery: Any, scratch: Any, *counts_and_out: Any
) -> list[tuple[Any, tuple[Any, ...]]]:
    """What takes longest to compile of `advance`, by types, the longest first."""
    *_, count, out = counts_and_out
    lanes, signals, routes = (scenery.types[name] for name in ("lanes", "signals", "routes"))
    walk, scenarios = scenery.types["walk"], scenery.types["scenarios"]
    return [
        (_move_traffic, (state, scenery, scratch, count, count)),
        (move_walkers, (state, walk, signals, scratch.types["neighbours"], count, count)),
        (detect_events, (state, lanes, signals, routes, count, count, out, count)),
        (watch_scenarios, (state, scenarios, signals, routes, count, out, count)),
        (locate_ego, (state, lanes, count)),
        (resolve_contacts, (state, out, count)),
        (move_scenarios, (state, scenarios, signals, count, count)),
    ]


@made_of(_parts_of_advance)
@kernel
def advance(
    state: State,
    scenery: Scenery,
    scratch: Scratch,
    vehicle_end: int,
    walker_end: int,
    ticks: int,
    out: Float64,
) -> int:
    """Moves a world on by `ticks` ticks; the egos' controls are held in the state.

    Args:
        state: The world, changed in place.
        scenery: What it stands on.
        scratch: Working memory.
        vehicle_end: First actor id behind the vehicles.
        walker_end: First actor id behind the walkers, who follow them.
        ticks: How many ticks.
        out: (N, 8) rows for events, see `event_rows`.

    Returns:
        The number of event rows written.
    """
    egos = state.throttle.size
    n = 0
    for _ in range(ticks):
        state.tick[()] += 1
        advance_lights(state, scenery.signals)
        _move_traffic(state, scenery, scratch, egos, vehicle_end)
        move_walkers(
            state, scenery.walk, scenery.signals, scratch.neighbours, vehicle_end, walker_end
        )
        move_scenarios(state, scenery.scenarios, scenery.signals, vehicle_end, walker_end)
        for ego in range(egos):
            if state.kind[ego] != _ABSENT:
                move_ego(state, ego, scenery.ego_model)
        n = resolve_contacts(state, out, n)
        for ego in range(egos):
            if state.kind[ego] != _ABSENT:
                locate_ego(state, scenery.lanes, ego)
                note_ego_arrival(state, scenery.lanes, ego)
                advance_progress(state, scenery.routes, ego)
            n = watch_scenarios(
                state, scenery.scenarios, scenery.signals, scenery.routes, ego, out, n
            )
            if state.kind[ego] != _ABSENT:
                n = detect_events(
                    state,
                    scenery.lanes,
                    scenery.signals,
                    scenery.routes,
                    ego,
                    vehicle_end,
                    out,
                    n,
                )
    return n


@kernel
def _move_traffic(
    state: State, scenery: Scenery, scratch: Scratch, egos: int, vehicle_end: int
) -> None:
    """All vehicles decide from the same state, then all move."""
    lanes, signals, tables = scenery.lanes, scenery.signals, scenery.tables
    occupancy, requests, leaders = scratch.occupancy, scratch.requests, scratch.leaders
    mark_busy_crosswalks(state, scenery.walk, scratch.busy)
    fill_occupancy(occupancy, state, lanes, egos, vehicle_end)
    bring_back(occupancy, state, lanes, tables, egos, vehicle_end)
    occupy_crossings(occupancy, state, scenery.scenarios, lanes, scratch.below)
    change_lanes(occupancy, state, lanes, tables, egos, vehicle_end)
    find_leaders(leaders, occupancy, state, lanes, tables, egos, vehicle_end)
    update_grants(requests, occupancy, state, lanes, signals, egos, vehicle_end, leaders)
    take_another_way(state, lanes, tables, requests, egos, vehicle_end)
    for actor in range(egos, vehicle_end):
        if state.kind[actor] != _ABSENT:
            scratch.acceleration[actor], scratch.cap[actor] = choose_speed(
                state, lanes, tables, leaders, requests, scratch.busy, egos, actor
            )
            if state.shock_ticks[actor] > 0:  # who was hit stands on the brakes, or slides
                scratch.acceleration[actor] = -GRIP_MPS2
    for actor in range(egos, vehicle_end):
        if state.kind[actor] != _ABSENT:
            move_vehicle(
                state, lanes, tables, actor, scratch.acceleration[actor], scratch.cap[actor]
            )
    pass_shocks(state, egos, vehicle_end)
