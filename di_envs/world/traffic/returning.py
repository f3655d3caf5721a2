"""Vehicles that have left the town by an open end come back elsewhere, where no ego looks."""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, keyed_hash
from di_envs.town.lanes import Lanes
from di_envs.world.state import TICK_S, ActorKind, State
from di_envs.world.traffic.motion import choose_path, forget_way, place_vehicle
from di_envs.world.traffic.occupancy import Occupancy, insert_vehicle
from di_envs.world.traffic.tables import TrafficTables

TRY_TICKS = round(1.0 / TICK_S)  # between two draws of a place
AWAY_FROM_EGO_M = 60.0  # from every ego …
IN_SIGHT_M = 120.0  # … and from those that look that way
FREE_M = 12.0  # of the lane before the place, from its middle, and all of it behind

_ABSENT = int(ActorKind.ABSENT)
_STREAM = int(Stream.TRAFFIC_RETURN)


@kernel
def bring_back(
    occupancy: Occupancy,
    state: State,
    lanes: Lanes,
    tables: TrafficTables,
    egos: int,
    vehicle_end: int,
) -> None:
    """Lets each vehicle that is away, once a second, draw a place and come back if it is free."""
    seed, tick, places = int(state.seed[()]), int(state.tick[()]), tables.entry_lane.size
    for actor in range(egos, vehicle_end):
        if state.away[actor] == 0 or places == 0 or (tick + actor) % TRY_TICKS != 0:
            continue
        place = int(keyed_hash(seed, _STREAM, tick, actor) % np.uint64(places))
        if _is_hidden(state, tables, egos, place) and _is_free(occupancy, tables, place):
            _come_back(occupancy, state, lanes, tables, actor, place)


@kernel
def _is_hidden(state: State, tables: TrafficTables, egos: int, place: int) -> bool:
    """Whether a place is far from all egos, further from those that look that way."""
    for ego in range(egos):
        if state.kind[ego] == _ABSENT:
            continue
        dx = tables.entry_pose[place, 0] - state.x[ego]
        dy = tables.entry_pose[place, 1] - state.y[ego]
        before = dx * math.cos(state.yaw[ego]) + dy * math.sin(state.yaw[ego]) > 0.0
        if math.hypot(dx, dy) < (IN_SIGHT_M if before else AWAY_FROM_EGO_M):
            return False
    return True


@kernel
def _is_free(occupancy: Occupancy, tables: TrafficTables, place: int) -> bool:
    """Whether nobody is on a place's lane, up to some way before it."""
    body = occupancy.first[tables.entry_lane[place]]
    return body < 0 or occupancy.rear_m[body] > tables.entry_m[place] + FREE_M


@kernel
def _come_back(
    occupancy: Occupancy,
    state: State,
    lanes: Lanes,
    tables: TrafficTables,
    actor: int,
    place: int,
) -> None:
    """Sets a vehicle down at rest, as what it was before."""
    state.kind[actor] = state.away[actor]
    state.away[actor] = 0
    forget_way(state, actor)
    state.lane[actor] = state.path[actor, 0] = tables.entry_lane[place]
    state.lane_m[actor] = tables.entry_m[place]
    choose_path(state, lanes, tables, actor, 1)
    place_vehicle(state, lanes, actor)
    insert_vehicle(occupancy, state, lanes, actor)
