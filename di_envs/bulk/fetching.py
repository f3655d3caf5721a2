"""Fetches what the next world's vehicles and walkers stand on while the one before it is stepped.

A town's points take megabytes, and every world needs others of them. Sixteen worlds in turn find
hardly any in the near caches, where one alone, stepped over and over, finds them all.
"""

from __future__ import annotations

from di_envs.numerics.kernels import kernel
from di_envs.numerics.prefetching import prefetch
from di_envs.town.lanes import Lanes
from di_envs.world.state import ActorKind, State
from di_envs.world.traffic.motion import AXLE_SHARE
from di_envs.world.traffic.tables import TrafficTables
from di_envs.world.walkers.walk_graph import WalkGraph

_ABSENT, _EGOS = int(ActorKind.ABSENT), 1


@kernel
def fetch_traffic(state: State, lanes: Lanes, tables: TrafficTables, vehicle_end: int) -> None:
    """The points at the axles of each vehicle, and the speed where it is."""
    for actor in range(_EGOS, vehicle_end):
        lane = state.lane[actor]
        if state.kind[actor] == _ABSENT or lane < 0:
            continue
        axle_m = AXLE_SHARE * state.half_length[actor]
        _fetch_point(lanes, lane, state.lane_m[actor] - axle_m)
        _fetch_point(lanes, lane, state.lane_m[actor] + axle_m)
        prefetch(tables.point_speed, _point(lanes, lane, state.lane_m[actor]))


@kernel
def _point(lanes: Lanes, lane: int, station_m: float) -> int:
    """A lane's point before a station, but the last one: there is one behind it."""
    before = int(station_m / lanes.spacing_m[lane])
    return lanes.first[lane] + min(max(before, 0), lanes.count[lane] - 2)


@kernel
def _fetch_point(lanes: Lanes, lane: int, station_m: float) -> None:
    """The points on either side of a station."""
    point = _point(lanes, lane, station_m)
    prefetch(lanes.points, point)
    prefetch(lanes.points, point + 1)


@kernel
def fetch_walkers(state: State, walk: WalkGraph, first: int, end: int) -> None:
    """The points of their edges between which the walkers [first, end) are bound."""
    for walker in range(first, end):
        edge = state.walk_edge[walker]
        if edge < 0:
            continue
        before = min(int(state.walk_m[walker] / walk.spacing_m[edge]), walk.size[edge] - 2)
        prefetch(walk.points, walk.first[edge] + before)
        prefetch(walk.points, walk.first[edge] + before + 1)
