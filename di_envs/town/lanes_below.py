"""Kernels that tell which lanes a box lies on; they know height, as those of `queries` do.

World frame; a lane is a band of its own width around its points.
"""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.arrays import Float64, Int32
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import LaneKind, Lanes
from di_envs.town.queries import LEVEL_M, square_to

_DRIVING = int(LaneKind.DRIVING)
_MOST_LANES_BELOW = 4
_ABREAST_M = 0.3  # a little more than half the distance between two points
_WIDEST_LANE_M = 8.0  # how far a box looks for lanes that reach below it


@kernel
def lanes_below_box(
    lanes: Lanes,
    x: float,
    y: float,
    z: float,
    yaw: float,
    half_length: float,
    half_width: float,
    out: Int32,
) -> int:
    """Which driving lanes an oriented box overlaps.

    Args:
        lanes: The network.
        x, y, z, yaw: The box's ground pose.
        half_length, half_width: Its size [m].
        out: (4 or more,) int32, filled with the lanes, the nearest to the box's centre first,
            then -1.

    Returns:
        How many there are, at most 4.
    """
    nearest = np.full(_MOST_LANES_BELOW, 1e30)  # squared distances of those in `out`
    out[:] = -1
    columns, cell = lanes.grid_size[0], lanes.cell_m[0]
    reach = math.hypot(half_length, half_width) + 0.5 * _WIDEST_LANE_M
    c, s = math.cos(yaw), math.sin(yaw)
    low_i, high_i = _cells(x, reach, lanes.grid_origin[0], cell, columns)
    low_j, high_j = _cells(y, reach, lanes.grid_origin[1], cell, lanes.grid_size[1])
    for j in range(low_j, high_j):
        row = j * columns
        for n in range(lanes.cell_start[row + low_i], lanes.cell_start[row + high_i]):
            point = lanes.cell_point[n]
            lane = lanes.point_lane[point]
            square = square_to(lanes, point, x, y)
            if square > reach * reach or lanes.kind[lane] != _DRIVING:
                continue
            if abs(lanes.points[point, 2] - z) > LEVEL_M:
                continue
            dx, dy = lanes.points[point, 0] - x, lanes.points[point, 1] - y
            ahead, right, turn = c * dx + s * dy, c * dy - s * dx, lanes.points[point, 3] - yaw
            if _touches(ahead, right, turn, lanes.width_m[point], half_length, half_width):
                _keep_nearest(out, nearest, lane, square)
    return _count_found(out)


@kernel
def _count_found(out: Int32) -> int:
    """How many lanes stand at the front of a list that -1 ends."""
    found = 0
    while found < _MOST_LANES_BELOW and out[found] >= 0:
        found += 1
    return found


@kernel
def _cells(centre: float, reach: float, origin: float, cell: float, size: int) -> tuple[int, int]:
    """The range [low, high) of grid cells within reach along one axis."""
    low = min(max(math.floor((centre - reach - origin) / cell), 0), size)
    high = min(max(math.floor((centre + reach - origin) / cell) + 1, low), size)
    return low, high


@kernel
def _touches(
    ahead: float, right: float, turn: float, width: float, half_length: float, half_width: float
) -> bool:
    """Whether a lane's band reaches into a box abreast of one of its points.

    Abreast: the box's nearest point must lie beside it, not before or behind, or a lane would
    reach beyond its ends. Where the two do overlap, there is such a point.

    Args:
        ahead, right: The point in the box's frame [m].
        turn: The lane's yaw in the box's frame [rad].
        width: The lane's width there [m].
        half_length, half_width: The box's size [m].
    """
    gap_x = min(max(ahead, -half_length), half_length) - ahead  # from the point to the box
    gap_y = min(max(right, -half_width), half_width) - right
    if gap_x * gap_x + gap_y * gap_y >= 0.25 * width * width:
        return False
    if gap_x == 0.0 and gap_y == 0.0:  # the point is in the box
        return True
    return abs(gap_x * math.cos(turn) + gap_y * math.sin(turn)) <= _ABREAST_M


@kernel
def _keep_nearest(out: Int32, nearest: Float64, lane: int, square: float) -> None:
    """Enters a lane into the nearest ones, `out`, by squared distances, `nearest` (4,) [m2]."""
    at = _MOST_LANES_BELOW - 1  # the place given up: that of the same lane, else the last
    for n in range(_MOST_LANES_BELOW):
        if out[n] == lane:
            at = n
            break
    if square >= nearest[at]:
        return
    while at > 0 and nearest[at - 1] > square:
        nearest[at], out[at] = nearest[at - 1], out[at - 1]
        at -= 1
    nearest[at], out[at] = square, lane
