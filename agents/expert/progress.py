"""Where the expert is on its path, and where the path lies, lane changes included, as kernels."""

from __future__ import annotations

import math
from typing import NamedTuple

from agents.expert.base_line import STEP_M
from agents.expert.path import DrivePath
from di_envs.numerics.kernels import kernel


class Progress(NamedTuple):
    """What the expert remembers between two decisions."""

    station_m: float  # of the car's centre on the path
    changes: int  # lane changes committed to so far
    change_begin_m: float  # station where the latest of them began
    change_length_m: float
    line: int  # next stop line
    stood_s: float  # for which it has stood at that line
    waiting_s: float  # for which it has waited for a gap to change lanes
    still_s: float  # for which it has stood, kept until it really drives again
    yellow_s: float  # for which it has seen the next light yellow


@kernel
def shift_at(path: DrivePath, progress: Progress, station_m: float) -> tuple[float, float, float]:
    """Offset of the path from the base line [m, positive right], and its first two derivatives."""
    value, slope, bend = 0.0, 0.0, 0.0
    for k in range(max(progress.changes - 1, 0), path.change_jump_m.size):
        if station_m < path.change_jump_m[k]:
            break
        shift = path.change_shift_m[k]
        if k >= progress.changes:
            value += shift
            continue
        length = progress.change_length_m
        u = (station_m - progress.change_begin_m) / length
        if u <= 0.0:
            value += shift
        elif u < 1.0:  # a quintic: no jump in curvature at either end
            value += shift * (1.0 - u * u * u * (10.0 - u * (15.0 - 6.0 * u)))
            slope -= shift * 30.0 * u * u * (1.0 - u) * (1.0 - u) / length
            bend -= shift * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (length * length)
    return value, slope, bend


@kernel
def lane_after_change(path: DrivePath, change: int, station_m: float) -> float:
    """Offset of the lane to which a change leads from the base line, before and behind it too."""
    value = 0.0
    for k in range(path.change_jump_m.size):
        if k <= change and station_m < path.change_jump_m[k]:
            value -= path.change_shift_m[k]
        elif k > change and station_m >= path.change_jump_m[k]:
            value += path.change_shift_m[k]
    return value


@kernel
def _point(path: DrivePath, progress: Progress, index: int) -> tuple[float, float]:
    """x, y of the path at a base point, shifted where a lane change is not yet made."""
    shift, _, _ = shift_at(path, progress, index * STEP_M)
    yaw = path.yaw[index]
    return path.x[index] - shift * math.sin(yaw), path.y[index] + shift * math.cos(yaw)


@kernel
def pose_at(
    path: DrivePath, progress: Progress, station_m: float
) -> tuple[float, float, float, float]:
    """(x, y, yaw, curvature [1/m]) of the path at a station; straight on before its start."""
    last = path.x.size - 2
    index = min(max(int(station_m / STEP_M), 0), last)
    share = station_m / STEP_M - index
    x0, y0 = _point(path, progress, index)
    x1, y1 = _point(path, progress, index + 1)
    _, slope, bend = shift_at(path, progress, station_m)
    yaw = path.yaw[index] + min(max(share, 0.0), 1.0) * (path.yaw[index + 1] - path.yaw[index])
    return (
        x0 + share * (x1 - x0),
        y0 + share * (y1 - y0),
        yaw + math.atan(slope),
        path.curvature[index] + bend,
    )


@kernel
def speed_at(path: DrivePath, station_m: float) -> float:
    """Target speed [m/s] of the path at a station."""
    index = min(max(int(station_m / STEP_M), 0), path.x.size - 1)
    return path.speed_mps[index]


@kernel
def height_at(path: DrivePath, station_m: float) -> float:
    """Height [m] of the path at a station, world frame."""
    return path.z[min(max(int(station_m / STEP_M), 0), path.x.size - 1)]


@kernel
def nearest_index(path: DrivePath, x: float, y: float, begin: int, end: int, stride: int) -> int:
    """The path's base point nearest to a place, among every `stride`-th of [begin, end)."""
    best, found = math.inf, begin
    for index in range(begin, end, stride):
        dx, dy = path.x[index] - x, path.y[index] - y
        square = dx * dx + dy * dy
        if square < best:
            best, found = square, index
    return found


@kernel
def project(
    path: DrivePath, progress: Progress, x: float, y: float, begin: int, end: int
) -> tuple[float, float, float]:
    """Station and offset of a place from the path, searched among base points [begin, end).

    Returns:
        (station [m], offset from the path [m, positive right], yaw of the path there).
    """
    coarse = nearest_index(path, x, y, begin, end, 8)
    index = nearest_index(path, x, y, max(coarse - 8, begin), min(coarse + 9, end), 1)
    yaw = path.yaw[index]
    dx, dy = x - path.x[index], y - path.y[index]
    along = math.cos(yaw) * dx + math.sin(yaw) * dy
    across = math.cos(yaw) * dy - math.sin(yaw) * dx
    # The shift of the point found, not of the station: at a jump the two lie on different lanes.
    shift, slope, _ = shift_at(path, progress, index * STEP_M)
    return index * STEP_M + along, across - shift - slope * along, yaw + math.atan(slope)


@kernel
def localise(path: DrivePath, progress: Progress, x: float, y: float) -> tuple[float, float, float]:
    """The station nearest to the car, near the last one: a path may cross itself.

    Returns:
        As of `project`.
    """
    index = int(progress.station_m / STEP_M)
    begin = max(index - 8, 0)
    end = min(index + 24, path.x.size)
    station, offset, yaw = project(path, progress, x, y, begin, end)
    return max(station, 0.0), offset, yaw
