"""What stands beside the road for good: buildings, trees, lamp posts, decks, rails, pillars.

Places are drawn by key on grids over the town and kept where the ground raster has nothing but
grass, so that nothing ever stands on a lane or a sidewalk. A town's scenery is the same in every
episode.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.sensors.scene.boxes import BoxSpec, Material
from di_envs.sensors.scene.surfaces import ELEVATED_M, GRASS, TEXEL_M
from di_envs.sensors.scene.tags import Tag
from di_envs.town.lanes import LaneKind, Lanes
from di_envs.town.town import Town

SLAB_M = 10.0  # length of a deck's pieces
SHORT_SLAB_M = 2.0  # what is bent is cut shorter, down to this …
STEP_M = 0.012  # … as long as a flat piece is so far from its lanes: the steps between would show
DECK_THICKNESS_M = 1.3
EMBANKMENT_M = 4.0  # decks lower than this stand on earth
PILLAR_EVERY_M = 24.0
LAMP_EVERY_M = 28.0
BUILDING_EVERY_M, TREE_EVERY_M = 26.0, 11.0
BUILDING_GAP_M = 3.0  # free ground round a building
TREE_GAP_M = 1.2

_WALLS = (
    (0.58, 0.50, 0.43),
    (0.50, 0.30, 0.24),
    (0.66, 0.64, 0.60),
    (0.42, 0.44, 0.48),
    (0.70, 0.62, 0.48),
)
_LEAVES = ((0.20, 0.33, 0.12), (0.26, 0.38, 0.15), (0.17, 0.28, 0.13), (0.34, 0.38, 0.16))
_CONCRETE = (0.52, 0.51, 0.49)
_STEEL = (0.62, 0.63, 0.65)


def _draw(kind: int, i: int, j: int, channel: int) -> float:
    """A number in [0, 1) for a place of a grid."""
    return float(uniform(kind * 16 + channel, int(Stream.SCENERY), i, j + 100000))


class FreeGround:
    """Where there is nothing but grass, by sums over the raster at half a metre."""

    _STEP = 3  # texels a cell

    def __init__(self, classes: NDArray[np.uint8], origin: NDArray[np.float64]) -> None:
        rows, columns = (side // self._STEP for side in classes.shape)
        whole = classes[: rows * self._STEP, : columns * self._STEP] != GRASS
        self._taken = whole.reshape(rows, self._STEP, columns, self._STEP).any(axis=(1, 3))
        self._origin, self._cell = origin, self._STEP * TEXEL_M
        self._sum_up()

    def _sum_up(self) -> None:
        self._sums = np.pad(np.cumsum(np.cumsum(self._taken, axis=0), axis=1), ((1, 0), (1, 0)))

    @property
    def size_m(self) -> tuple[float, float]:
        rows, columns = self._taken.shape
        return columns * self._cell, rows * self._cell

    def _cells(self, x: float, y: float, half_x: float, half_y: float) -> tuple[int, int, int, int]:
        i0 = math.floor((x - half_x - self._origin[0]) / self._cell)
        i1 = math.ceil((x + half_x - self._origin[0]) / self._cell)
        j0 = math.floor((y - half_y - self._origin[1]) / self._cell)
        j1 = math.ceil((y + half_y - self._origin[1]) / self._cell)
        return i0, i1, j0, j1

    def is_free(self, x: float, y: float, half_x: float, half_y: float) -> bool:
        """Whether a rectangle along the axes lies on grass alone, inside the raster."""
        i0, i1, j0, j1 = self._cells(x, y, half_x, half_y)
        rows, columns = self._taken.shape
        if i0 < 0 or j0 < 0 or i1 > columns or j1 > rows:
            return False
        sums = self._sums
        return int(sums[j1, i1] - sums[j0, i1] - sums[j1, i0] + sums[j0, i0]) == 0

    def take(self, places: list[tuple[float, float, float, float]]) -> None:
        """Marks rectangles (x, y, half x, half y) as no longer free."""
        rows, columns = self._taken.shape
        for place in places:
            i0, i1, j0, j1 = self._cells(*place)
            self._taken[max(j0, 0) : min(j1, rows), max(i0, 0) : min(i1, columns)] = True
        self._sum_up()


def scenery_of(
    town: Town, base_z: float, classes: NDArray[np.uint8], origin: NDArray[np.float64]
) -> list[BoxSpec]:
    """All static boxes of a town.

    Args:
        town: The town.
        base_z: Height of its plane [m].
        classes: (H, W) classes of the plane's raster.
        origin: (2,) x, y of the raster's corner.
    """
    free = FreeGround(classes, origin)
    slabs = list(_slabs(town, base_z))
    decks = list(_decks(slabs, base_z, free))
    free.take([(s["x"], s["y"], s["reach"], s["reach"]) for s in slabs])
    lamps = list(_lamp_posts(town, base_z, free))
    buildings = list(_buildings(base_z, free, origin))
    trees = list(_trees(base_z, free, origin))
    return [*decks, *lamps, *buildings, *trees]


def _slabs(town: Town, base_z: float) -> Iterator[dict[str, Any]]:
    """The elevated roads in pieces: where each lies, how it is turned and how large it is."""
    lanes = town.lanes
    lane = lanes.point_lane
    index = np.flatnonzero(lanes.points[:, 2] - base_z > ELEVATED_M)
    # point_lane follows the order of points
    keys = lanes.road[lane[index]].astype(np.int64) * 100000 + np.floor(
        lanes.road_m[index] / SLAB_M
    ).astype(np.int64)
    order = np.argsort(keys, kind="stable")
    index, keys = index[order], keys[order]
    cuts = np.flatnonzero(np.diff(keys)) + 1
    for rows in _flat_pieces(lanes, np.split(index, cuts)):
        points, half_width = lanes.points[rows], lanes.width_m[rows] / 2.0
        twice = np.exp(2j * points[:, 3]).mean()  # lanes of both directions lie on one axis
        yaw = float(np.angle(twice)) / 2.0
        c, s = math.cos(yaw), math.sin(yaw)
        along = c * points[:, 0] + s * points[:, 1]
        across = c * points[:, 1] - s * points[:, 0]
        u0, u1 = along.min() - 0.4, along.max() + 0.4
        v0, v1 = (across - half_width).min(), (across + half_width).max()
        middle_u, middle_v = (u0 + u1) / 2.0, (v0 + v1) / 2.0
        if np.ptp(along) > 0.5:
            slope, level = np.polyfit(along - middle_u, points[:, 2], 1).tolist()
        else:
            slope, level = 0.0, float(points[:, 2].mean())
        yield {
            "x": c * middle_u - s * middle_v,
            "y": s * middle_u + c * middle_v,
            "z": level,
            "yaw": yaw,
            "pitch": math.atan(slope),
            "half_length": (u1 - u0) / 2.0,
            "half_width": (v1 - v0) / 2.0,
            "reach": math.hypot(u1 - u0, v1 - v0) / 2.0,
            "station": int(keys[cuts[0] - 1]) if cuts.size else 0,
        }


def _flat_pieces(lanes: Lanes, pieces: list[NDArray[Any]]) -> Iterator[NDArray[Any]]:
    """Rows of points of each piece of an elevated road, cut in two as long as it is bent."""
    for rows in pieces:
        if rows.size < 2:
            continue
        station, z = lanes.road_m[rows], lanes.points[rows, 2]
        long = float(np.ptp(station))
        if long > 2.0 * SHORT_SLAB_M:
            flat = np.polyval(np.polyfit(station, z, 1), station)
            if np.abs(z - flat).max() > STEP_M:
                first = station < station.min() + long / 2.0
                yield from _flat_pieces(lanes, [rows[first], rows[~first]])
                continue
        yield rows


def _decks(slabs: list[dict[str, Any]], base_z: float, free: FreeGround) -> Iterator[BoxSpec]:
    """Decks or embankments, with rails along both sides and pillars below."""
    every = max(1, round(PILLAR_EVERY_M / SLAB_M))
    for number, slab in enumerate(slabs):
        c, s = math.cos(slab["yaw"]), math.sin(slab["yaw"])
        above = slab["z"] - base_z
        thick = above + 0.5 if above < EMBANKMENT_M else DECK_THICKNESS_M
        half_length = slab["half_length"] / math.cos(slab["pitch"])
        yield BoxSpec(
            centre=(
                slab["x"] + c * math.sin(slab["pitch"]) * thick / 2.0,
                slab["y"] + s * math.sin(slab["pitch"]) * thick / 2.0,
                slab["z"] - math.cos(slab["pitch"]) * thick / 2.0,
            ),
            half=(half_length, slab["half_width"], thick / 2.0),
            yaw=slab["yaw"],
            pitch=slab["pitch"],
            colour=_CONCRETE,
            tag=Tag.BRIDGE,
            material=Material.DECK,
        )
        for side in (-1.0, 1.0):
            out = side * (slab["half_width"] - 0.12)
            if above > 1.0:
                yield BoxSpec(
                    centre=(slab["x"] - s * out, slab["y"] + c * out, slab["z"] + 0.4),
                    half=(half_length, 0.12, 0.4),
                    yaw=slab["yaw"],
                    pitch=slab["pitch"],
                    colour=_STEEL,
                    tag=Tag.GUARD_RAIL,
                )
            far = side * slab["half_width"] * 0.55
            x, y = slab["x"] - s * far, slab["y"] + c * far
            if above > EMBANKMENT_M and number % every == 0 and free.is_free(x, y, 1.3, 1.3):
                high = above - DECK_THICKNESS_M
                yield BoxSpec(
                    centre=(x, y, base_z + high / 2.0),
                    half=(0.7, 0.9, high / 2.0),
                    yaw=slab["yaw"],
                    colour=_CONCRETE,
                    tag=Tag.BRIDGE,
                )


def _lamp_posts(town: Town, base_z: float, free: FreeGround) -> Iterator[BoxSpec]:
    """Posts beyond the sidewalks, their arms over the street."""
    lanes = town.lanes
    placed: list[tuple[float, float, float, float]] = []
    for lane in np.flatnonzero(lanes.kind == LaneKind.SIDEWALK).tolist():
        out = 1.0 if lanes.lane_id[lane] < 0 else -1.0
        step = max(1, round(LAMP_EVERY_M / lanes.spacing_m[lane]))
        for k in range(step // 2, int(lanes.count[lane]), step):
            x, y, z, yaw = lanes.points[lanes.first[lane] + k].tolist()
            if abs(z - base_z) > ELEVATED_M:
                continue
            reach = out * (lanes.width_m[lanes.first[lane] + k] / 2.0 + 0.7)
            px, py = x - math.sin(yaw) * reach, y + math.cos(yaw) * reach
            if not free.is_free(px, py, 0.4, 0.4):
                continue
            placed.append((px, py, 0.6, 0.6))
            yield BoxSpec(
                centre=(px, py, z + 3.75),
                half=(0.09, 0.09, 3.75),
                yaw=yaw,
                colour=(0.3, 0.31, 0.33),
                tag=Tag.POLES,
            )
            ax, ay = px + math.sin(yaw) * out * 1.6, py - math.cos(yaw) * out * 1.6
            yield BoxSpec(
                centre=(ax, ay, z + 7.5),
                half=(0.08, 1.7, 0.06),
                yaw=yaw,
                colour=(0.3, 0.31, 0.33),
                tag=Tag.POLES,
            )
    free.take(placed)


def _buildings(base_z: float, free: FreeGround, origin: NDArray[np.float64]) -> Iterator[BoxSpec]:
    """Blocks with windows, each with a flat roof set on; drawn on a grid, along its axes."""
    placed: list[tuple[float, float, float, float]] = []
    size_x, size_y = free.size_m
    for j in range(int(size_y / BUILDING_EVERY_M) + 1):
        for i in range(int(size_x / BUILDING_EVERY_M) + 1):
            d = [_draw(1, i, j, channel) for channel in range(8)]
            half_x, half_y = 5.0 + 6.0 * d[0], 5.0 + 6.0 * d[1]
            room_x = max(0.0, BUILDING_EVERY_M / 2.0 - half_x)
            room_y = max(0.0, BUILDING_EVERY_M / 2.0 - half_y)
            x = origin[0] + (i + 0.5) * BUILDING_EVERY_M + (2.0 * d[2] - 1.0) * room_x
            y = origin[1] + (j + 0.5) * BUILDING_EVERY_M + (2.0 * d[3] - 1.0) * room_y
            gap = BUILDING_GAP_M
            if not free.is_free(x, y, half_x + gap, half_y + gap):
                half_x, half_y = 5.0, 5.0
                if d[4] > 0.8 or not free.is_free(x, y, half_x + gap, half_y + gap):
                    continue
            placed.append((x, y, half_x + 1.0, half_y + 1.0))
            floors = 2 + int(7.0 * d[5] * d[5]) if d[6] < 0.85 else 6 + int(6.0 * d[5])
            high = 3.2 * floors + 0.6
            wall = _WALLS[int(d[7] * len(_WALLS))]
            yield BoxSpec(
                centre=(x, y, base_z + high / 2.0),
                half=(half_x, half_y, high / 2.0),
                colour=wall,
                tag=Tag.BUILDINGS,
                material=Material.WINDOWS,
            )
            roof = (0.6 * wall[0], 0.6 * wall[1], 0.6 * wall[2])
            yield BoxSpec(
                centre=(x, y, base_z + high + 0.25),
                half=(half_x + 0.25, half_y + 0.25, 0.25),
                colour=roof,
                tag=Tag.BUILDINGS,
            )
    free.take(placed)


def _trees(base_z: float, free: FreeGround, origin: NDArray[np.float64]) -> Iterator[BoxSpec]:
    """Trees of a trunk and three boxes of leaves."""
    size_x, size_y = free.size_m
    for j in range(int(size_y / TREE_EVERY_M) + 1):
        for i in range(int(size_x / TREE_EVERY_M) + 1):
            d = [_draw(2, i, j, channel) for channel in range(6)]
            x = origin[0] + (i + d[0]) * TREE_EVERY_M
            y = origin[1] + (j + d[1]) * TREE_EVERY_M
            wide = 1.3 + 1.3 * d[2]
            # a crown may reach over a sidewalk, a trunk may not stand on one
            if d[3] > 0.6 or not free.is_free(x, y, TREE_GAP_M, TREE_GAP_M):
                continue
            high, leaf = 4.5 + 4.0 * d[4], _LEAVES[int(d[5] * len(_LEAVES))]
            yaw = 1.5 * d[4]
            yield BoxSpec(
                centre=(x, y, base_z + 0.25 * high),
                half=(0.16, 0.16, 0.25 * high),
                colour=(0.26, 0.19, 0.13),
                tag=Tag.VEGETATION,
            )
            for k, (spread, up, tall) in enumerate(
                ((1.0, 0.62, 0.16), (0.72, 0.80, 0.20), (0.85, 0.57, 0.11))
            ):
                yield BoxSpec(
                    centre=(x, y, base_z + up * high),
                    half=(wide * spread, wide * spread, tall * high),
                    yaw=yaw + 0.7 * k,
                    colour=leaf,
                    tag=Tag.VEGETATION,
                    material=Material.FOLIAGE,
                )
