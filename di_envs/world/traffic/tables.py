"""What traffic needs of a town beyond its lanes, computed once: speeds, side lanes, crosswalks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.town.lanes import LaneKind
from di_envs.town.queries import pose_at
from di_envs.town.town import Town

LATERAL_ACCELERATION_MPS2 = 2.0  # that drivers accept in bends
SLOWING_MPS2 = 2.0  # with which they slow down for a bend ahead
SLOWEST_BEND_MPS = 3.0
ENTRY_M = 5.0  # into a lane by which one comes into the town: more than half the longest vehicle
ENTRY_LANE_M = 12.0  # a lane by which one comes is at least so long …
LONG_LANE_M = 60.0  # … or so long, where it has another before it


@by_reference
class TrafficTables(NamedTuple):
    """Arrays over the lanes L, points P and crosswalks X of a town."""

    point_speed: NDArray[np.float64]  # (P,) speed limit, bends and slowing for them included [m/s]
    first_speed: NDArray[np.float64]  # (L,) of these, that at each lane's first point
    usable: NDArray[np.int8]  # (L,) 1 where traffic can drive on for ever, or to an open end
    # where vehicles come into the town (N,), those that have left it by an open end
    entry_lane: NDArray[np.int32]
    entry_pose: NDArray[np.float64]  # (N, 2) x, y
    entry_m: NDArray[np.float64]  # station on the lane
    # junction lanes that begin at the same approach lane: they overlap up to `sibling_end_m`
    sibling_start: NDArray[np.int32]  # (L + 1,)
    sibling_lane: NDArray[np.int32]
    sibling_end_m: NDArray[np.float64]
    # crosswalks that lie on a lane
    crossing_start: NDArray[np.int32]  # (L + 1,)
    crossing: NDArray[np.int32]  # crosswalk index
    crossing_begin_m: NDArray[np.float64]


def traffic_tables(town: Town) -> TrafficTables:
    """Computes the tables of a town."""
    siblings = _siblings(town)
    crossings = _crossings(town)
    usable = _usable_lanes(town)
    entries = _entries(town, usable)
    speeds = _point_speeds(town)
    return TrafficTables(
        point_speed=speeds,
        first_speed=speeds[town.lanes.first],
        usable=usable,
        entry_lane=entries[0],
        entry_pose=entries[1],
        entry_m=entries[2],
        sibling_start=siblings[0],
        sibling_lane=siblings[1],
        sibling_end_m=siblings[2],
        crossing_start=crossings[0],
        crossing=crossings[1],
        crossing_begin_m=crossings[2],
    )


def _point_speeds(town: Town) -> NDArray[np.float64]:
    lanes = town.lanes
    speeds = np.empty(lanes.points.shape[0])
    for lane in range(lanes.kind.size):
        own = slice(lanes.first[lane], lanes.first[lane] + lanes.count[lane])
        spacing = lanes.spacing_m[lane]
        yaw = lanes.points[own, 3]
        curvature = np.abs(np.gradient(yaw, spacing)) if yaw.size > 2 else np.zeros(yaw.size)
        bend = np.sqrt(LATERAL_ACCELERATION_MPS2 / np.maximum(curvature, 1e-6))
        speed = np.minimum(lanes.speed_limit_mps[lane], np.maximum(bend, SLOWEST_BEND_MPS))
        for k in range(speed.size - 2, -1, -1):
            reachable = np.sqrt(speed[k + 1] ** 2 + 2.0 * SLOWING_MPS2 * spacing)
            speed[k] = min(speed[k], reachable)
        speeds[own] = speed
    return speeds


def _usable_lanes(town: Town) -> NDArray[np.int8]:
    """Driving lanes that lead on for ever, or to an open end.

    Those without a usable successor go, until none does. Where a lane ends beside one that goes
    on, its road only becomes narrower: that is no open end, and nobody drives there.
    """
    lanes = town.lanes
    usable = (lanes.kind == LaneKind.DRIVING) & (lanes.length_m > 0.0)
    open_end = _open_ends(town)
    changed = True
    while changed:
        changed = False
        for lane in np.flatnonzero(usable & ~open_end):
            ahead = lanes.successor[lanes.successor_start[lane] : lanes.successor_start[lane + 1]]
            if not usable[ahead].any():
                usable[lane] = False
                changed = True
    return usable.astype(np.int8)


def _open_ends(town: Town) -> NDArray[np.bool_]:
    """(L,) whether a road ends with this lane: neither it nor one beside it leads on."""
    lanes = town.lanes
    ends = _alone(town, np.diff(lanes.successor_start) == 0)
    return (lanes.kind == LaneKind.DRIVING) & ends & (lanes.junction < 0)


def _alone(town: Town, unlinked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(L,) whether neither a lane nor any beside it is linked: a road's end, no change of width."""
    lanes, alone = town.lanes, unlinked.copy()
    for lane in np.flatnonzero(unlinked):
        for side in (lanes.left, lanes.right):
            beside = int(side[lane])
            while beside >= 0:
                alone[lane] &= unlinked[beside]
                beside = int(side[beside])
    return alone


def _entries(
    town: Town, usable: NDArray[np.int8]
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
    """Where roads begin to which none leads; in towns without such, the middles of long lanes."""
    lanes = town.lanes
    roads = (usable == 1) & (lanes.junction < 0)
    first = _alone(town, np.diff(lanes.predecessor_start) == 0)
    entry = np.flatnonzero(roads & first & (lanes.length_m >= ENTRY_LANE_M))
    station = np.full(entry.size, ENTRY_M)
    if entry.size == 0:
        entry = np.flatnonzero(roads & (lanes.length_m >= LONG_LANE_M))
        station = 0.5 * lanes.length_m[entry]
    places = [pose_at(lanes, int(k), float(s))[:2] for k, s in zip(entry, station, strict=True)]
    return entry.astype(np.int32), np.array(places, np.float64).reshape(-1, 2), station


def _siblings(
    town: Town,
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
    lanes = town.lanes
    start, other, end = [0], [], []
    for lane in range(lanes.kind.size):
        for k in range(lanes.conflict_start[lane], lanes.conflict_start[lane + 1]):
            if lanes.conflict_begin_m[k] < 0.5 and lanes.conflict_other_begin_m[k] < 0.5:
                if _share_predecessor(town, lane, int(lanes.conflict_lane[k])):
                    other.append(int(lanes.conflict_lane[k]))
                    end.append(float(lanes.conflict_other_end_m[k]))
        start.append(len(other))
    return np.array(start, np.int32), np.array(other, np.int32), np.array(end, np.float64)


def _share_predecessor(town: Town, a: int, b: int) -> bool:
    lanes = town.lanes
    before = [
        set(lanes.predecessor[lanes.predecessor_start[i] : lanes.predecessor_start[i + 1]].tolist())
        for i in (a, b)
    ]
    return a != b and bool(before[0] & before[1])


def _crossings(
    town: Town,
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
    """Crosswalks on each lane, in order: (first row of each lane, crosswalk, its begin [m])."""
    walks = town.crosswalks
    rows: list[list[tuple[float, int]]] = [[] for _ in range(town.lanes.kind.size)]
    for crosswalk in range(walks.width_m.size):
        for k in range(walks.crossed_start[crosswalk], walks.crossed_start[crosswalk + 1]):
            rows[walks.crossed_lane[k]].append((float(walks.crossed_begin_m[k]), crosswalk))
    flat = [entry for row in rows for entry in sorted(row)]
    start = np.cumsum([0] + [len(row) for row in rows])
    return (
        start.astype(np.int32),
        np.array([crosswalk for _, crosswalk in flat], np.int32),
        np.array([begin for begin, _ in flat], np.float64),
    )
