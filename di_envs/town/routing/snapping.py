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
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import Lanes
from di_envs.town.routing.carla_roads import CarlaRoads
from di_envs.town.routing.pieces import Piece
from di_envs.town.routing.traces import Ruler, Trace, places_by_road, rows_of
from di_envs.town.town import Town

SCAN_M = 1.0  # along the reference line
MAX_CHORD_M = 100.0
MAX_TURN_RAD = math.pi / 100.0


class Chords(NamedTuple):
    """M chords of pieces of driving lanes."""

    piece: NDArray[np.int32]  # (M,) index of the piece
    lane: NDArray[np.int32]  # (M,) lane that it is a piece of
    begin: NDArray[np.float64]  # (M, 3) x, y, z
    end: NDArray[np.float64]  # (M, 3)
    begin_road_m: NDArray[np.float64]  # (M,) along the reference line, from the lane's begin
    end_road_m: NDArray[np.float64]  # (M,)


class Snap(NamedTuple):
    """The place on a driving lane that a point was put on."""

    piece: int
    lane: int
    place: Trace  # that one place
    distance_m: float  # from the point, in three dimensions


def lay_chords(town: Town, ruler: Ruler, pieces: Sequence[Piece], roads: CarlaRoads) -> Chords:
    """Lays chords along pieces of lanes, in their order."""
    lanes = town.lanes
    scans = [np.append(np.arange(p.begin_m, p.end_m, SCAN_M), p.end_m) for p in pieces]
    counts = np.array([len(scan) for scan in scans])
    owner = np.repeat(np.arange(len(pieces), dtype=np.int32), counts)
    scan_m = np.concatenate(scans)
    piece_lane = np.array([piece.lane for piece in pieces], dtype=np.int32)
    points = places_by_road(lanes, ruler, piece_lane[owner], scan_m).points
    rise = np.concatenate([_rise(town, roads, p, s) for p, s in zip(pieces, scans, strict=True)])
    cuts = _cuts(owner, scan_m, _directions(points[:, 3], rise))
    begin, end = cuts[:-1], cuts[1:]
    within = owner[begin] == owner[end]
    begin, end = begin[within], end[within]
    return Chords(
        piece=owner[begin],
        lane=piece_lane[owner[begin]],
        begin=points[begin, :3],
        end=points[end, :3],
        begin_road_m=scan_m[begin],
        end_road_m=scan_m[end],
    )


def snap_to_lane(lanes: Lanes, ruler: Ruler, chords: Chords, position: NDArray[np.float64]) -> Snap:
    """Puts a point on the nearest chord's lane.

    Args:
        lanes: The town's lanes.
        ruler: Of these lanes.
        chords: Chords of the lanes that may be chosen.
        position: (3,) x, y, z.
    """
    step, from_begin = chords.end - chords.begin, position - chords.begin
    share = _share(from_begin, step)
    away_m = np.linalg.norm(from_begin - share[:, None] * step, axis=1)
    best = int(np.argmin(away_m))
    one = slice(best, best + 1)
    # CARLA measures along the chord in the plane
    flat_share = _share(from_begin[one, :2], step[one, :2])
    along_m = chords.begin_road_m[one] + flat_share * np.hypot(*step[best, :2])
    along_m = np.minimum(along_m, chords.end_road_m[one])
    place = places_by_road(lanes, ruler, chords.lane[one], along_m)
    return Snap(int(chords.piece[best]), int(chords.lane[best]), place, float(away_m[best]))


def _share(offset: NDArray[np.float64], step: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far along each step its offset reaches, from 0 to 1."""
    square = np.einsum("ij,ij->i", step, step)
    along = np.einsum("ij,ij->i", offset, step)
    return np.clip(along / np.where(square > 0.0, square, 1.0), 0.0, 1.0)


def _rise(
    town: Town, roads: CarlaRoads, piece: Piece, scan_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """How steeply a piece rises in the direction of travel, along a scan of it."""
    lanes = town.lanes
    rows = rows_of(lanes, piece.lane)
    begin, end = float(lanes.road_m[rows.start]), float(lanes.road_m[rows.stop - 1])
    sign = 1.0 if end >= begin else -1.0
    return sign * roads.slopes(town.road_names[lanes.road[piece.lane]], begin + sign * scan_m)


def _directions(yaw: NDArray[np.float64], pitch: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) unit vectors by (N,) headings and pitches."""
    flat = np.cos(pitch)
    return np.stack([flat * np.cos(yaw), flat * np.sin(yaw), np.sin(pitch)], axis=1)


def _cuts(
    owner: NDArray[np.int32], scan_m: NDArray[np.float64], directions: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Rows where one chord ends and the next begins, ends of pieces included."""
    least_cosine = math.cos(MAX_TURN_RAD)
    owners, stations = owner.tolist(), scan_m.tolist()
    vectors = list(zip(*directions.T.tolist(), strict=True))
    cuts = [0]
    for i in range(1, len(owners)):
        if owners[i] != owners[i - 1]:
            cuts += [i - 1, i]
            continue
        a, b = vectors[cuts[-1]], vectors[i]
        cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        if cosine < least_cosine or stations[i] - stations[cuts[-1]] > MAX_CHORD_M:
            cuts.append(i)
    return np.unique([*cuts, len(owners) - 1])
