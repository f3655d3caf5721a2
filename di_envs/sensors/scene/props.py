"""What stands beside the road for good: buildings, trees, lamp posts; decks are in `decks.py`.

Places are drawn by key on grids over the town and kept where the ground raster has nothing but
grass, so that nothing ever stands on a lane or a sidewalk. A town's scenery is the same in every
episode.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from di_envs.numerics.arrays import Float64, UInt8
from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.sensors.scene.boxes import BoxSpec, Material
from di_envs.sensors.scene.decks import decks_of, slabs_of
from di_envs.sensors.scene.free_ground import FreeGround
from di_envs.sensors.scene.surfaces import ELEVATED_M
from di_envs.sensors.scene.tags import Tag
from di_envs.town.lanes import LaneKind
from di_envs.town.town import Town

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


def _draw(kind: int, i: int, j: int, channel: int) -> float:
    """A number in [0, 1) for a place of a grid."""
    return float(uniform(kind * 16 + channel, int(Stream.SCENERY), i, j + 100000))


def scenery_of(town: Town, base_z: float, classes: UInt8, origin: Float64) -> list[BoxSpec]:
    """All static boxes of a town.

    Args:
        town: The town.
        base_z: Height of its plane [m].
        classes: (H, W) classes of the plane's raster.
        origin: (2,) x, y of the raster's corner.
    """
    free = FreeGround(classes, origin)
    slabs = list(slabs_of(town, base_z))
    decks = list(decks_of(slabs, base_z, free))
    free.take([(slab.x, slab.y, slab.reach, slab.reach) for slab in slabs])
    lamps = list(_lamp_posts(town, base_z, free))
    buildings = list(_buildings(base_z, free, origin))
    trees = list(_trees(base_z, free, origin))
    return [*decks, *lamps, *buildings, *trees]


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


def _buildings(base_z: float, free: FreeGround, origin: Float64) -> Iterator[BoxSpec]:
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


def _trees(base_z: float, free: FreeGround, origin: Float64) -> Iterator[BoxSpec]:
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
