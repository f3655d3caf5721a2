"""Kernels that find poses and lanes in a town: all know height, so a bridge is not the road below.

World frame; stations are metres along a lane in its direction of travel; lateral offsets are
positive to the right. `kind_mask` is a sum of `1 << LaneKind`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from di_envs.numerics.arrays import Float64
from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import LaneKind, Lanes

STRIDE = 32  # points between those of a lane that are looked at first
LEVEL_M = 2.5  # a lane further above or below does not count
DRIVING_MASK = 1 << int(LaneKind.DRIVING)


@kernel
def segment_at(lanes: Lanes, lane: int, s: float) -> tuple[int, float]:
    """The point before station s on a lane, and the fraction of the way to the next one."""
    position = min(max(s, 0.0), lanes.length_m[lane]) / lanes.spacing_m[lane]
    k = min(int(position), lanes.count[lane] - 2)
    return lanes.first[lane] + k, min(position - k, 1.0)


@kernel
def pose_at(lanes: Lanes, lane: int, s: float) -> tuple[float, float, float, float]:
    """(x, y, z, yaw) at station s [m] of a lane, clamped to the lane."""
    i, f = segment_at(lanes, lane, s)
    p = lanes.points
    return (
        p[i, 0] + f * (p[i + 1, 0] - p[i, 0]),
        p[i, 1] + f * (p[i + 1, 1] - p[i, 1]),
        p[i, 2] + f * (p[i + 1, 2] - p[i, 2]),
        p[i, 3] + f * (p[i + 1, 3] - p[i, 3]),
    )


@kernel
def width_at(lanes: Lanes, lane: int, s: float) -> float:
    """Width [m] at station s [m] of a lane, clamped to the lane."""
    i, f = segment_at(lanes, lane, s)
    return lanes.width_m[i] + f * (lanes.width_m[i + 1] - lanes.width_m[i])


@kernel
def _on_segment(points: Float64, i: int, x: float, y: float) -> tuple[float, float, float]:
    """A place against the segment from point i of (P, 4): (fraction, lateral [m], square [m2])."""
    ax, ay = points[i, 0], points[i, 1]
    ux, uy = points[i + 1, 0] - ax, points[i + 1, 1] - ay
    square = ux * ux + uy * uy
    if square < 1e-18:
        ux, uy = math.cos(points[i, 3]), math.sin(points[i, 3])
        square, f = 1.0, 0.0
    else:
        f = min(max(((x - ax) * ux + (y - ay) * uy) / square, 0.0), 1.0)
    lateral = ((y - ay) * ux - (x - ax) * uy) / math.sqrt(square)
    dx, dy = x - ax - f * ux, y - ay - f * uy
    return f, lateral, dx * dx + dy * dy


@kernel
def _project_near(
    lanes: Lanes, lane: int, k: int, x: float, y: float
) -> tuple[float, float, float]:
    """Projects onto the two segments beside a lane's point k: (points, lateral, square [m2])."""
    first, last = lanes.first[lane], lanes.count[lane] - 2
    best_k, best_f, best_lateral, best_square = 0, 0.0, 0.0, 1e30
    for j in range(max(k - 1, 0), min(k, last) + 1):
        f, lateral, square = _on_segment(lanes.points, first + j, x, y)
        if square < best_square:
            best_k, best_f, best_lateral, best_square = j, f, lateral, square
    return best_k + best_f, best_lateral, best_square


@kernel
def project_to_lane(
    lanes: Lanes, lane: int, x: float, y: float, hint_m: float = -1.0
) -> tuple[float, float]:
    """(station, lateral) [m] of a point on a lane, clamped to the lane's ends.

    With `hint_m`, a station near the answer, it walks downhill from there: quick, and it stays on
    the near arm of a lane that bends back. Without, it looks at every point.
    """
    if hint_m < 0.0:
        nearest = _nearest_point(lanes, lane, x, y)
    else:
        nearest = _walk_downhill(lanes, lane, x, y, int(hint_m / lanes.spacing_m[lane] + 0.5))
    position, lateral, _ = _project_near(lanes, lane, nearest, x, y)
    return position * lanes.spacing_m[lane], lateral


@kernel
def square_to(lanes: Lanes, point: int, x: float, y: float) -> float:
    """Squared distance [m2] from a point of the network, seen from above."""
    dx, dy = lanes.points[point, 0] - x, lanes.points[point, 1] - y
    return dx * dx + dy * dy


@kernel
def _nearest_point(lanes: Lanes, lane: int, x: float, y: float) -> int:
    """Which of a lane's points, counted along it, is nearest, the first of several as near.

    It leaps over those that cannot be: `n` points on from one that is `d` away, none is nearer than
    `d` less `n` of the lane's longest steps.
    """
    first, count, step = lanes.first[lane], lanes.count[lane], lanes.longest_step_m[lane]
    nearest, least = 0, square_to(lanes, first, x, y)
    for k in range(STRIDE, count, STRIDE):
        square = square_to(lanes, first + k, x, y)
        if square < least:
            nearest, least = k, square
    best_m = math.sqrt(least)
    k = 0
    while k < count:
        square = square_to(lanes, first + k, x, y)
        if square < least or (square == least and k < nearest):
            nearest, least, best_m = k, square, math.sqrt(square)
        # the last one leapt over is a whole step further away than the best: rounding is nothing
        k += max(int((math.sqrt(square) - best_m) / step), 1)
    return nearest


@kernel
def _walk_downhill(lanes: Lanes, lane: int, x: float, y: float, start: int) -> int:
    """Which of a lane's points is nearest, as far as each step from `start` comes nearer."""
    first, count = lanes.first[lane], lanes.count[lane]
    nearest = min(max(start, 0), count - 1)
    least = square_to(lanes, first + nearest, x, y)
    for step in (1, -1):
        k = nearest + step
        while 0 <= k < count:
            square = square_to(lanes, first + k, x, y)
            if square >= least:
                break
            nearest, least = k, square
            k += step
    return nearest


class Sought(NamedTuple):
    """What a search looks for: lanes of some kinds near a place."""

    x: float
    y: float
    z: float
    yaw: float
    aligned: bool  # only lanes within 90 degrees of that yaw
    kind_mask: int


class Found(NamedTuple):
    """The lane that a search found, and where on it."""

    lane: int  # -1 for none
    station_m: float
    lateral_m: float
    distance_m: float  # from its centre line; the most allowed as long as there is none


@kernel
def _search(lanes: Lanes, sought: Sought, max_distance_m: float) -> Found:
    """Nearest lane by centre line: rings of cells around the place, until no nearer can follow."""
    cell = lanes.cell_m[0]
    column = math.floor((sought.x - lanes.grid_origin[0]) / cell)
    row = math.floor((sought.y - lanes.grid_origin[1]) / cell)
    best = Found(as_int64(-1), 0.0, 0.0, max_distance_m)
    for ring in range(int(max_distance_m / cell) + 2):
        # A point that projects onto a segment lies at most half a metre from one of its points.
        if (ring - 1) * cell > best.distance_m + 0.5:
            break
        best = _search_ring(lanes, sought, column, row, ring, best)
    return best


@kernel
def _search_ring(
    lanes: Lanes, sought: Sought, column: int, row: int, ring: int, best: Found
) -> Found:
    """The better of what was found and what the cells hold that are `ring` cells away."""
    columns, rows = lanes.grid_size[0], lanes.grid_size[1]
    for j in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
        whole_row = j == row - ring or j == row + ring
        stride = 1 if whole_row else max(2 * ring, 1)
        for i in range(column - ring, column + ring + 1, stride):
            if 0 <= i < columns:
                best = _search_cell(lanes, sought, j * columns + i, best)
    return best


@kernel
def _search_cell(lanes: Lanes, sought: Sought, cell: int, best: Found) -> Found:
    """The better of what was found and what the lanes with points in a cell offer."""
    for n in range(lanes.cell_start[cell], lanes.cell_start[cell + 1]):
        point = lanes.cell_point[n]
        if _may_be_better(lanes, sought, point, best):
            best = _better(lanes, sought, point, best)
    return best


@kernel
def _may_be_better(lanes: Lanes, sought: Sought, point: int, best: Found) -> bool:
    """Whether a point's lane is one that is looked for, and near enough; quick to check."""
    lane = lanes.point_lane[point]
    if not (sought.kind_mask >> lanes.kind[lane]) & 1:
        return False
    if abs(lanes.points[point, 2] - sought.z) > LEVEL_M:
        return False
    reach = best.distance_m + 0.5 * lanes.spacing_m[lane] + 1e-9
    if square_to(lanes, point, sought.x, sought.y) > reach * reach:
        return False
    return not (sought.aligned and math.cos(lanes.points[point, 3] - sought.yaw) <= 0.0)


@kernel
def _better(lanes: Lanes, sought: Sought, point: int, best: Found) -> Found:
    """A point's lane near that point, if its centre line is nearer there than what was found."""
    lane = lanes.point_lane[point]
    position, lateral, square = _project_near(
        lanes, lane, point - lanes.first[lane], sought.x, sought.y
    )
    distance = math.sqrt(square)
    if distance < best.distance_m or (distance == best.distance_m and best.lane < 0):
        return Found(as_int64(lane), position * lanes.spacing_m[lane], lateral, distance)
    return best


@kernel
def nearest_lane(
    lanes: Lanes, x: float, y: float, z: float, max_distance_m: float, kind_mask: int
) -> Found:
    """The lane whose centre is nearest, and where on it.

    Lanes further than `max_distance_m`, or more than 2.5 m above or below, do not count: lane -1.
    Lateral is to the lane's tangent there, so beyond a lane's end it may be less than the distance.
    """
    return _search(lanes, Sought(x, y, z, 0.0, False, kind_mask), max_distance_m)


@kernel
def nearest_driving_lane_towards(
    lanes: Lanes, x: float, y: float, z: float, yaw: float, max_distance_m: float
) -> Found:
    """As `nearest_lane` for driving lanes, those within 90 degrees of `yaw` first."""
    mask = as_int64(DRIVING_MASK)
    found = _search(lanes, Sought(x, y, z, yaw, True, mask), max_distance_m)
    if found.lane >= 0:
        return found
    return _search(lanes, Sought(x, y, z, yaw, False, mask), max_distance_m)
