"""Kernels that find poses and lanes in a town: all know height, so a bridge is not the road below.

World frame; stations are metres along a lane in its direction of travel; lateral offsets are
positive to the right. `kind_mask` is a sum of `1 << LaneKind`.
"""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import LaneKind

LEVEL_M = 2.5  # a lane further above or below does not count
DRIVING_MASK = 1 << int(LaneKind.DRIVING)
DRIVABLE_MASK = DRIVING_MASK | 1 << int(LaneKind.PARKING)
ANY_MASK = (1 << len(LaneKind)) - 1

_DRIVING = int(LaneKind.DRIVING)
_MOST_LANES_BELOW = 4
_ABREAST_M = 0.3  # a little more than half the distance between two points
_WIDEST_LANE_M = 8.0  # how far a box looks for lanes that reach below it


@kernel
def segment_at(lanes, lane, s):
    """The point before station s on a lane, and the fraction of the way to the next one."""
    position = min(max(s, 0.0), lanes.length_m[lane]) / lanes.spacing_m[lane]
    k = min(int(position), lanes.count[lane] - 2)
    return lanes.first[lane] + k, min(position - k, 1.0)


@kernel
def pose_at(lanes, lane, s):
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
def width_at(lanes, lane, s):
    """Width [m] at station s [m] of a lane, clamped to the lane."""
    i, f = segment_at(lanes, lane, s)
    return lanes.width_m[i] + f * (lanes.width_m[i + 1] - lanes.width_m[i])


@kernel
def _on_segment(points, i, x, y):
    """A point against the segment from point i: (fraction, lateral, squared distance) [m]."""
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
def _project_near(points, first, count, k, x, y):
    """Projects onto the two segments beside a lane's point k: (points, lateral, square [m2]).

    Takes arrays, not the whole network: that passes dozens of them, too slow for an inner loop.
    """
    last = count - 2
    best_k, best_f, best_lateral, best_square = 0, 0.0, 0.0, 1e30
    for j in range(max(k - 1, 0), min(k, last) + 1):
        f, lateral, square = _on_segment(points, first + j, x, y)
        if square < best_square:
            best_k, best_f, best_lateral, best_square = j, f, lateral, square
    return best_k + best_f, best_lateral, best_square


@kernel
def project_to_lane(lanes, lane, x, y, hint_m=-1.0):
    """(station, lateral) [m] of a point on a lane, clamped to the lane's ends.

    With `hint_m`, a station near the answer, it walks downhill from there: quick, and it stays on
    the near arm of a lane that bends back. Without, it looks at every point.
    """
    first, count = lanes.first[lane], lanes.count[lane]
    points = lanes.points
    best, best_square = 0, 1e30
    if hint_m < 0.0:
        for k in range(count):
            dx, dy = points[first + k, 0] - x, points[first + k, 1] - y
            square = dx * dx + dy * dy
            if square < best_square:
                best, best_square = k, square
    else:
        best = min(max(int(hint_m / lanes.spacing_m[lane] + 0.5), 0), count - 1)
        dx, dy = points[first + best, 0] - x, points[first + best, 1] - y
        best_square = dx * dx + dy * dy
        for step in (1, -1):
            k = best + step
            while 0 <= k < count:
                dx, dy = points[first + k, 0] - x, points[first + k, 1] - y
                square = dx * dx + dy * dy
                if square >= best_square:
                    break
                best, best_square = k, square
                k += step
    position, lateral, _ = _project_near(points, first, count, best, x, y)
    return position * lanes.spacing_m[lane], lateral


@kernel
def _search(lanes, x, y, z, yaw, aligned, max_distance_m, kind_mask):
    """Nearest lane by centre line: (lane, station, lateral, distance), lane -1 for none.

    Looks at rings of cells around the point until no closer one can follow.
    """
    points, point_lane, kind = lanes.points, lanes.point_lane, lanes.kind
    first, count, spacing = lanes.first, lanes.count, lanes.spacing_m
    cell_start, cell_point, cell = lanes.cell_start, lanes.cell_point, lanes.cell_m[0]
    columns, rows = lanes.grid_size[0], lanes.grid_size[1]
    column = math.floor((x - lanes.grid_origin[0]) / cell)
    row = math.floor((y - lanes.grid_origin[1]) / cell)
    best_lane, best_s, best_lateral, best = -1, 0.0, 0.0, max_distance_m
    for ring in range(int(max_distance_m / cell) + 2):
        # A point that projects onto a segment lies at most half a metre from one of its points.
        if (ring - 1) * cell > best + 0.5:
            break
        for j in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
            on_edge = j == row - ring or j == row + ring
            for i in range(column - ring, column + ring + 1, 1 if on_edge else max(2 * ring, 1)):
                if i < 0 or i >= columns:
                    continue
                for n in range(cell_start[j * columns + i], cell_start[j * columns + i + 1]):
                    point = cell_point[n]
                    lane = point_lane[point]
                    if not (kind_mask >> kind[lane]) & 1 or abs(points[point, 2] - z) > LEVEL_M:
                        continue
                    dx, dy = points[point, 0] - x, points[point, 1] - y
                    reach = best + 0.5 * spacing[lane] + 1e-9
                    if dx * dx + dy * dy > reach * reach:
                        continue
                    if aligned and math.cos(points[point, 3] - yaw) <= 0.0:
                        continue
                    position, lateral, square = _project_near(
                        points, first[lane], count[lane], point - first[lane], x, y
                    )
                    distance = math.sqrt(square)
                    if distance < best or (distance == best and best_lane < 0):
                        best_lane, best_lateral, best = lane, lateral, distance
                        best_s = position * spacing[lane]
    return best_lane, best_s, best_lateral, best


@kernel
def nearest_lane(lanes, x, y, z, max_distance_m, kind_mask):
    """(lane, station, lateral, distance) [m] of the lane whose centre is nearest.

    Lanes further than `max_distance_m`, or more than 2.5 m above or below, do not count: lane -1.
    Lateral is to the lane's tangent there, so beyond a lane's end it may be less than the distance.
    """
    return _search(lanes, x, y, z, 0.0, False, max_distance_m, kind_mask)


@kernel
def nearest_driving_lane_towards(lanes, x, y, z, yaw, max_distance_m):
    """As `nearest_lane` for driving lanes, those within 90 degrees of `yaw` first."""
    found = _search(lanes, x, y, z, yaw, True, max_distance_m, DRIVING_MASK)
    if found[0] >= 0:
        return found
    return _search(lanes, x, y, z, yaw, False, max_distance_m, DRIVING_MASK)


@kernel
def lanes_below_box(lanes, x, y, z, yaw, half_length, half_width, out):
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
    points, point_lane, kind, width = lanes.points, lanes.point_lane, lanes.kind, lanes.width_m
    cell_start, columns, cell = lanes.cell_start, lanes.grid_size[0], lanes.cell_m[0]
    reach = math.hypot(half_length, half_width) + 0.5 * _WIDEST_LANE_M
    c, s = math.cos(yaw), math.sin(yaw)
    low_i, high_i = _cells(x, reach, lanes.grid_origin[0], cell, columns)
    low_j, high_j = _cells(y, reach, lanes.grid_origin[1], cell, lanes.grid_size[1])
    for j in range(low_j, high_j):
        for n in range(cell_start[j * columns + low_i], cell_start[j * columns + high_i]):
            point = lanes.cell_point[n]
            lane = point_lane[point]
            dx, dy = points[point, 0] - x, points[point, 1] - y
            square = dx * dx + dy * dy
            if square > reach * reach or kind[lane] != _DRIVING:
                continue
            if abs(points[point, 2] - z) > LEVEL_M:
                continue
            ahead, right, turn = c * dx + s * dy, c * dy - s * dx, points[point, 3] - yaw
            if _touches(ahead, right, turn, width[point], half_length, half_width):
                _keep_nearest(out, nearest, lane, square)
    found = 0
    while found < _MOST_LANES_BELOW and out[found] >= 0:
        found += 1
    return found


@kernel
def _cells(centre, reach, origin, cell, size):
    """The range [low, high) of grid cells within reach along one axis."""
    low = min(max(math.floor((centre - reach - origin) / cell), 0), size)
    high = min(max(math.floor((centre + reach - origin) / cell) + 1, low), size)
    return low, high


@kernel
def _touches(ahead, right, turn, width, half_length, half_width):
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
    return abs(gap_x * math.cos(turn) + gap_y * math.sin(turn)) <= _ABREAST_M


@kernel
def _keep_nearest(out, nearest, lane, square):
    """Enters a lane into the list of the four nearest, both kept sorted by squared distance."""
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
