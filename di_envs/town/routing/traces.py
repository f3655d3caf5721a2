"""Places along lanes: what routes and snapped keypoints are made of.

Two measures run along a lane: its own station (`lane_m`, what the world uses) and the length of
its road's reference line. CARLA steps along that one: its steps are shorter inside a bend.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import Lanes

_KINK = 1e-4  # a smaller difference of rates is no kink


class Trace(NamedTuple):
    """N places along lanes."""

    points: NDArray[np.float64]  # (N, 4) x, y, z, yaw
    lane: NDArray[np.int32]  # (N,) lane index
    lane_m: NDArray[np.float64]  # (N,) station along it

    def part(self, rows: slice) -> Trace:
        """Some of the places."""
        return Trace(self.points[rows], self.lane[rows], self.lane_m[rows])


def join_traces(traces: list[Trace]) -> Trace:
    """Traces one after the other."""
    if not traces:
        return Trace(np.empty((0, 4)), np.empty(0, np.int32), np.empty(0))
    return Trace(
        points=np.concatenate([trace.points for trace in traces]),
        lane=np.concatenate([trace.lane for trace in traces]),
        lane_m=np.concatenate([trace.lane_m for trace in traces]),
    )


class Ruler(NamedTuple):
    """Turns distances along reference lines into rows of lane points, for all lanes at once.

    Lanes follow each other on one axis, `stride_m` apart; rows between two points are fractions.
    """

    stride_m: float
    key: NDArray[np.float64]  # ascending: lane x stride + distance from the lane's begin
    row: NDArray[np.float64]  # row of Lanes.points there


def lay_ruler(lanes: Lanes) -> Ruler:
    """Measures all lanes.

    Where a bend begins between two points, the lane's length per metre of road changes there: the
    place is found from the rates before and after, else steps would be off by up to 3 cm.
    """
    along_m = np.abs(lanes.road_m - lanes.road_m[lanes.first][lanes.point_lane])
    stride_m = 2.0 ** math.ceil(math.log2(float(along_m.max(initial=1.0)) + 2.0))
    key = (lanes.point_lane * stride_m + along_m).astype(np.float64)
    row = np.arange(len(key), dtype=np.float64)
    kink_key, kink_row = _kinks(lanes, key)
    key, row = np.append(key, kink_key), np.append(row, kink_row)
    order = np.argsort(key, kind="stable")
    return Ruler(stride_m, key[order], row[order])


def _kinks(
    lanes: Lanes, key: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Keys and rows where the rate of lane length to road length changes between two points."""
    chord_m = np.linalg.norm(np.diff(lanes.points[:, :3], axis=0), axis=1)
    road_m = np.diff(key)
    within = lanes.point_lane[1:] == lanes.point_lane[:-1]
    rate = np.where(within & (road_m > 0.0), chord_m / np.where(road_m > 0.0, road_m, 1.0), 1.0)
    # before the first point and after the last one a lane counts as straight: its rate is 1
    before = np.append(1.0, rate[:-1])
    after = np.append(rate[1:], 1.0)
    share = (rate - after) / np.where(np.abs(before - after) > _KINK, before - after, np.inf)
    i = np.flatnonzero(within & (share > _KINK) & (share < 1.0 - _KINK))
    bent_m = share[i] * road_m[i]
    return key[i] + bent_m, i + np.minimum(before[i] * bent_m / chord_m[i], 1.0)


def places_by_road(
    lanes: Lanes, ruler: Ruler, lane: NDArray[np.int32], road_m: NDArray[np.float64]
) -> Trace:
    """Places on lanes, given how far along the reference line each is from its lane's begin.

    Args:
        lanes: The town's lanes.
        ruler: Of these lanes.
        lane: (N,) lane indices.
        road_m: (N,) distances; beyond a lane's end its end is taken.
    """
    first, last = lanes.first[lane], lanes.first[lane] + lanes.count[lane] - 1
    row = np.interp(lane * ruler.stride_m + road_m, ruler.key, ruler.row)
    row = np.clip(row, first, last)
    begin = np.minimum(row.astype(np.int64), last - 1)
    share = (row - begin)[:, None]
    points = (1.0 - share) * lanes.points[begin] + share * lanes.points[begin + 1]
    return Trace(points, lane, (row - first) * lanes.spacing_m[lane])


def rows_of(lanes: Lanes, lane: int) -> slice:
    """The rows of a lane's points."""
    return slice(int(lanes.first[lane]), int(lanes.first[lane] + lanes.count[lane]))


def road_span_m(lanes: Lanes, lane: int) -> float:
    """Length of the reference line beside a lane."""
    rows = rows_of(lanes, lane)
    return abs(float(lanes.road_m[rows.stop - 1] - lanes.road_m[rows.start]))


def successors_of(lanes: Lanes, lane: int) -> list[int]:
    """The lanes that a lane leads into."""
    start, stop = lanes.successor_start[lane], lanes.successor_start[lane + 1]
    return [int(successor) for successor in lanes.successor[start:stop]]


def walk_beyond(lanes: Lanes, lane: int, road_m: float) -> tuple[int, float]:
    """Where one is so far along the reference lines, from a lane's begin on into its successors.

    Takes the first successor at each fork; a dead end ends the walk.

    Returns:
        A lane, and the distance from its begin.
    """
    while road_m > road_span_m(lanes, lane) and (ahead := successors_of(lanes, lane)):
        road_m -= road_span_m(lanes, lane)
        lane = ahead[0]
    return lane, road_m
