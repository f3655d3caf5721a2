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


def place_on_lane(lanes: Lanes, lane: int, lane_m: float) -> Trace:
    """One place on a lane."""
    return _places(lanes, lane, np.array([lane_m]))


def walk_lane(lanes: Lanes, lane: int, step_m: float) -> Trace:
    """Places on a lane at equal steps of its road's reference line, the beginning left out."""
    steps = math.floor(road_span_m(lanes, lane) / step_m + 1e-9)
    return places_by_road(lanes, lane, np.arange(1.0, steps + 1.0) * step_m)


def walk_beyond(lanes: Lanes, lane: int, road_m: float) -> Trace:
    """The place so far along the reference lines, from a lane's begin on into its successors.

    Takes the first successor at each fork; a dead end ends the walk.
    """
    while road_m > road_span_m(lanes, lane) and (ahead := successors_of(lanes, lane)):
        road_m -= road_span_m(lanes, lane)
        lane = ahead[0]
    return places_by_road(lanes, lane, np.array([road_m]))


def places_by_road(lanes: Lanes, lane: int, road_m: NDArray[np.float64]) -> Trace:
    """Places on a lane, given how far along the reference line each is from the lane's begin."""
    rows = rows_of(lanes, lane)
    along_m = np.abs(lanes.road_m[rows] - lanes.road_m[rows.start])
    return _places(lanes, lane, np.interp(road_m, along_m, _stations(lanes, lane)))


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


def _places(lanes: Lanes, lane: int, lane_m: NDArray[np.float64]) -> Trace:
    rows, stations = rows_of(lanes, lane), _stations(lanes, lane)
    columns = [np.interp(lane_m, stations, lanes.points[rows, column]) for column in range(4)]
    return Trace(np.stack(columns, axis=-1), np.full(len(lane_m), lane, np.int32), lane_m)


def _stations(lanes: Lanes, lane: int) -> NDArray[np.float64]:
    return np.linspace(0.0, float(lanes.length_m[lane]), int(lanes.count[lane]))
