"""The town's lanes cut into short polylines, with a grid that says which are near a place.

Computed once a town; the map component of the prompt is then a choice among them. Nothing here
knows of routes.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.town.kept import kept
from di_envs.town.lanes import LaneKind, Lanes
from di_envs.town.once import once_a_town
from di_envs.town.town import Town

POINTS = 10  # points of a polyline
SPACING_M = 2.0  # between them, at most
RANGE_M = 50.0  # how near a polyline must come to be on the map
CELL_M = 16.0  # side of a grid cell

_LEFT_BIT, _RIGHT_BIT = 1, 2  # of Lanes.change


class MapKind(IntEnum):
    """What a map polyline is; NONE in empty slots."""

    NONE = 0
    LANE_CENTRE = 1
    BROKEN_LINE = 2  # between two lanes of one direction; may be crossed
    SOLID_LINE = 3  # a lane's edge that must not be crossed


@by_reference
class MapChunks(NamedTuple):
    """C polylines of `POINTS` points each, in the world frame, and a grid over the town."""

    points: NDArray[np.float64]  # (C, POINTS, 3) x, y, z
    kind: NDArray[np.int8]  # (C, POINTS) MapKind
    centre: NDArray[np.float64]  # (C, 2) of a circle round the points
    radius_m: NDArray[np.float64]  # (C,)
    grid_origin: NDArray[np.float64]  # (2,) x, y of the grid's corner
    grid_size: NDArray[np.int32]  # (2,) columns, rows
    cell_start: NDArray[np.int32]  # (columns * rows + 1,)
    cell_chunk: NDArray[np.int32]  # chunks that may be within RANGE_M of a place in the cell


@once_a_town
@kept
def map_chunks_of(town: Town) -> MapChunks:
    """The polylines of a town."""
    return build_map_chunks(town.lanes)


def build_map_chunks(lanes: Lanes) -> MapChunks:
    """Cuts every driving lane's centre and lines into polylines, and sorts them into a grid.

    Lines are drawn outside junctions, a line between two lanes once. Each lane is cut into equal
    pieces of at most `(POINTS - 1) * SPACING_M` metres that share their end points.
    """
    driving = np.flatnonzero(lanes.kind == LaneKind.DRIVING).tolist()
    lines = (line for lane in driving for line in _lines_of(lanes, lane))
    pieces = [piece for line in lines for piece in _cut(*line)]
    points = np.array([xyz for xyz, _ in pieces]).reshape(-1, POINTS, 3)
    kind = np.array([kinds for _, kinds in pieces], np.int8).reshape(-1, POINTS)
    low, high = points[:, :, :2].min(axis=1), points[:, :, :2].max(axis=1)
    centre = (low + high) / 2.0
    radius_m = np.linalg.norm(points[:, :, :2] - centre[:, None], axis=2).max(axis=1)
    return MapChunks(points, kind, centre, radius_m, *_grid(centre, radius_m))


def _lines_of(lanes: Lanes, lane: int) -> Iterator[tuple[NDArray[np.float64], NDArray[np.int8]]]:
    """The centre of a lane and its lines: (N, 3) points in lane order, (N,) kinds."""
    rows = slice(lanes.first[lane], lanes.first[lane] + lanes.count[lane])
    points, width_m, change = lanes.points[rows], lanes.width_m[rows], lanes.change[rows]
    yield points[:, :3], np.full(len(points), MapKind.LANE_CENTRE, np.int8)
    if lanes.junction[lane] >= 0:
        return
    right = np.stack([-np.sin(points[:, 3]), np.cos(points[:, 3]), np.zeros(len(points))], axis=1)
    reach = right * width_m[:, None] / 2.0
    yield points[:, :3] + reach, _line_kinds(change, _RIGHT_BIT, lanes.right[lane])
    if lanes.left[lane] < 0:  # otherwise it is the left neighbour's right line
        yield points[:, :3] - reach, _line_kinds(change, _LEFT_BIT, -1)


def _line_kinds(change: NDArray[np.int8], bit: int, neighbour: int) -> NDArray[np.int8]:
    """Broken where there is a neighbour and a change to it is allowed, solid elsewhere."""
    broken = (change & bit != 0) & (neighbour >= 0)
    return np.where(broken, MapKind.BROKEN_LINE, MapKind.SOLID_LINE).astype(np.int8)


def _cut(
    points: NDArray[np.float64], kinds: NDArray[np.int8]
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.int8]]]:
    """Pieces of a polyline, each of `POINTS` points at even spacing."""
    steps = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
    station = np.concatenate([[0.0], np.cumsum(steps)])
    pieces = max(1, int(np.ceil(station[-1] / ((POINTS - 1) * SPACING_M))))
    wanted = np.linspace(0.0, station[-1], pieces * (POINTS - 1) + 1)
    xyz = np.stack([np.interp(wanted, station, points[:, axis]) for axis in range(3)], axis=1)
    nearest = np.clip(np.searchsorted(station, wanted), 0, len(kinds) - 1)
    for piece in range(pieces):
        rows = slice(piece * (POINTS - 1), piece * (POINTS - 1) + POINTS)
        yield xyz[rows], kinds[nearest[rows]]


def _grid(
    centre: NDArray[np.float64], radius_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Lists, for each cell, the chunks whose circle comes within RANGE_M of the cell."""
    if len(centre) == 0:
        return np.zeros(2), np.zeros(2, np.int32), np.zeros(1, np.int32), np.zeros(0, np.int32)
    reach = radius_m + RANGE_M
    origin = (centre - reach[:, None]).min(axis=0)
    extent = (centre + reach[:, None]).max(axis=0) - origin
    size = np.ceil(extent / CELL_M).astype(np.int32)
    lists = []
    for row in range(size[1]):
        for column in range(size[0]):
            low = origin + CELL_M * np.array([column, row])
            gap = np.maximum(0.0, np.maximum(low - centre, centre - low - CELL_M))
            lists.append(np.flatnonzero(gap[:, 0] ** 2 + gap[:, 1] ** 2 <= reach**2))
    start = np.concatenate([[0], np.cumsum([len(chunks) for chunks in lists])])
    return origin, size, start.astype(np.int32), np.concatenate(lists).astype(np.int32)
