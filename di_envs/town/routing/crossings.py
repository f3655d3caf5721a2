"""Gives each junction that a route crosses to the one connector that it drives.

Where connectors begin or end on top of each other, CARLA's planner takes its first or last points
from any of them. The points stay where CARLA has them; the lane that they name becomes the one
that leads from the lane before the junction to the lane behind it.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import Lanes
from di_envs.town.routing.traces import Trace, rows_of, successors_of


def name_connectors(lanes: Lanes, trace: Trace) -> Trace:
    """The same places, with one connector named for each junction crossed.

    Crossings at which a route begins or ends, and those that no single connector makes, are left
    as they are.
    """
    lane, lane_m = trace.lane.copy(), trace.lane_m.copy()
    for begin, end in _crossings(lanes, trace.lane):
        if begin == 0 or end == len(lane):
            continue
        connector = _connector(lanes, lane, begin, end)
        if connector is None:
            continue
        other = begin + np.flatnonzero(lane[begin:end] != connector)
        lane[other] = connector
        lane_m[other] = _stations(lanes, connector, trace.points[other, :2])
    return trace._replace(lane=lane, lane_m=lane_m)


def _crossings(lanes: Lanes, lane: NDArray[np.int32]) -> list[tuple[int, int]]:
    """Ranges of points that lie in one junction."""
    junction = lanes.junction[lane]
    cuts = np.flatnonzero(np.diff(junction)) + 1
    edges = [0, *cuts.tolist(), len(lane)]
    return [(begin, end) for begin, end in pairwise(edges) if junction[begin] >= 0]


def _connector(lanes: Lanes, lane: NDArray[np.int32], begin: int, end: int) -> int | None:
    """The connector between the lanes before and behind; of several, the one named most."""
    source, target = int(lane[begin - 1]), int(lane[end])
    inside = lane[begin:end].tolist()
    leading = [c for c in successors_of(lanes, source) if target in successors_of(lanes, c)]
    return max(leading, key=inside.count, default=None)


def _stations(lanes: Lanes, lane: int, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Stations of the lane's points that are nearest to (N, 2) places."""
    points = lanes.points[rows_of(lanes, lane), :2]
    away = np.linalg.norm(places[:, None] - points[None], axis=2)
    stations: NDArray[np.float64] = away.argmin(axis=1) * float(lanes.spacing_m[lane])
    return stations
