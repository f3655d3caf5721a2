"""Puts points on driving lanes as CARLA's `Map.get_waypoint` does.

CARLA lays chords along each lane, a new one where the direction has turned by more than 1.8 degrees
or after 100 m; it takes the chord nearest in three dimensions, and the distance along that chord as
distance along the road's reference line. On a bend the two differ by up to 0.4 m, and with them the
route point at which one leg of a route ends and the next begins: hence the same chords here.

Source: behaviour of `LibCarla/source/carla/road/Map.cpp` (CARLA 0.9.12 to 0.9.16, Computer Vision
Center, MIT licence); the code here is ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import Lanes
from di_envs.town.traces import Trace, places_by_road, road_span_m

SCAN_M = 1.0  # along the reference line
MAX_CHORD_M = 100.0
MAX_TURN_RAD = math.pi / 100.0


class Chords(NamedTuple):
    """M straight pieces of driving lanes."""

    lane: NDArray[np.int32]  # (M,)
    begin: NDArray[np.float64]  # (M, 3) x, y, z
    end: NDArray[np.float64]  # (M, 3)
    begin_road_m: NDArray[np.float64]  # (M,) along the reference line, from the lane's begin
    end_road_m: NDArray[np.float64]  # (M,)


class Snap(NamedTuple):
    """The place on a driving lane that a point was put on."""

    lane: int
    place: Trace  # that one place
    distance_m: float  # from the point, in three dimensions


def lay_chords(lanes: Lanes, chosen: list[int]) -> Chords:
    """Lays chords along the chosen lanes, in that order."""
    pieces = [_chords_of(lanes, lane) for lane in chosen]
    return Chords(*(np.concatenate(columns) for columns in zip(*pieces, strict=True)))


def snap_to_lane(lanes: Lanes, chords: Chords, position: NDArray[np.float64]) -> Snap:
    """Puts a point on the nearest chord's lane.

    Args:
        lanes: The town's lanes.
        chords: Chords of the lanes that may be chosen.
        position: (3,) x, y, z.
    """
    step, from_begin = chords.end - chords.begin, position - chords.begin
    share = _share(from_begin, step)
    away_m = np.linalg.norm(from_begin - share[:, None] * step, axis=1)
    best = int(np.argmin(away_m))
    lane = int(chords.lane[best])
    # CARLA measures along the chord in the plane
    flat = slice(best, best + 1)
    flat_share = _share(from_begin[flat, :2], step[flat, :2])[0]
    along_m = chords.begin_road_m[best] + flat_share * float(np.hypot(*step[best, :2]))
    along_m = min(along_m, float(chords.end_road_m[best]))
    place = places_by_road(lanes, lane, np.array([along_m]))
    return Snap(lane, place, float(away_m[best]))


def _share(offset: NDArray[np.float64], step: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far along each step its offset reaches, from 0 to 1."""
    square = np.einsum("ij,ij->i", step, step)
    along = np.einsum("ij,ij->i", offset, step)
    return np.clip(along / np.where(square > 0.0, square, 1.0), 0.0, 1.0)


def _chords_of(lanes: Lanes, lane: int) -> Chords:
    span_m = road_span_m(lanes, lane)
    scan_m = np.append(np.arange(0.0, span_m, SCAN_M), span_m)
    points = places_by_road(lanes, lane, scan_m).points
    cuts = _cuts(scan_m, _directions(points, scan_m))
    begin, end = cuts[:-1], cuts[1:]
    owner = np.full(len(begin), lane, np.int32)
    return Chords(owner, points[begin, :3], points[end, :3], scan_m[begin], scan_m[end])


def _directions(
    points: NDArray[np.float64], scan_m: NDArray[np.float64]
) -> list[tuple[float, float, float]]:
    """Unit vectors along the lane, by yaw and slope."""
    slope = np.arctan(np.gradient(points[:, 2], scan_m))
    yaw = points[:, 3]
    columns = np.cos(slope) * np.cos(yaw), np.cos(slope) * np.sin(yaw), np.sin(slope)
    return list(zip(*(column.tolist() for column in columns), strict=True))


def _cuts(
    scan_m: NDArray[np.float64], directions: list[tuple[float, float, float]]
) -> NDArray[np.int64]:
    """Where one chord ends and the next begins."""
    least_cosine = math.cos(MAX_TURN_RAD)
    cuts, last = [0], len(directions) - 1
    for i in range(1, last):
        cosine = sum(a * b for a, b in zip(directions[cuts[-1]], directions[i], strict=True))
        if cosine < least_cosine or scan_m[i] - scan_m[cuts[-1]] > MAX_CHORD_M:
            cuts.append(i)
    return np.array([*cuts, last])
