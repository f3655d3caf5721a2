"""The ground as a raster of colours and tags: lanes, lines, stop lines, crosswalks, grass.

Two rasters make a town: one for what lies on its plane, one for what is elevated (the tops of
decks).
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from di_envs.numerics.arrays import Bool, Float32, Float64, UInt8, UInt32
from di_envs.numerics.kernels import kernel
from di_envs.sensors.scene.grain import colour_classes
from di_envs.sensors.scene.patches import pave_patches
from di_envs.sensors.scene.raster import (
    TEXEL_M,
    Raster,
    Rectangle,
    fill_rectangle,
    paint_rectangle,
    with_levels,
)
from di_envs.sensors.scene.tags import Tag
from di_envs.town.lanes import LaneKind, Lanes
from di_envs.town.town import Town

MARGIN_M = 24.0  # of grass round the town
ELEVATED_M = 0.05  # above the plane from which a lane is on a deck
LINE_M = 0.15  # width of a lane line
LINE_INSET_M = 0.12  # of its middle from the lane's edge
MIDDLE_INSET_M = 0.18  # alike for the yellow line, two of which side by side stay two
DASH_M, DASH_EVERY_M = 3.0, 9.0
STOP_LINE_M = 0.4
BAR_M = 0.5  # width of a crosswalk's bars, and of the gaps between
ISLAND_M2 = 60.0  # grass enclosed by lanes of a junction is paved up to this size
_OVERLAP_M = 0.08  # of the pieces of a lane or a line, where it bends
_MAY_CHANGE_RIGHT = 2  # the bit of Lanes.change
_DRIVING = int(LaneKind.DRIVING)

WHITE, YELLOW = (225, 225, 220), (222, 178, 50)
GRASS, ASPHALT, SHOULDER, PAVEMENT, KERB, CONCRETE = 0, 1, 2, 3, 4, 5
_COLOURS = np.array(
    [(88, 112, 58), (84, 85, 88), (96, 96, 97), (158, 152, 144), (132, 130, 126), (140, 138, 134)],
    np.float32,
)
_GRAIN = np.array([16.0, 7.0, 8.0, 7.0, 6.0, 6.0], np.float32)  # of brightness, in levels
_TAGS = np.array(
    [Tag.TERRAIN, Tag.ROADS, Tag.ROADS, Tag.SIDEWALKS, Tag.SIDEWALKS, Tag.BRIDGE], np.uint8
)
_HOLDS_WATER = np.array([0, 1, 1, 0, 0, 0], np.uint8)
_CLASS_OF_LANE = {
    LaneKind.SIDEWALK: PAVEMENT,
    LaneKind.OTHER: KERB,
    LaneKind.SHOULDER: SHOULDER,
    LaneKind.PARKING: SHOULDER,
    LaneKind.BIKING: SHOULDER,
    LaneKind.DRIVING: ASPHALT,
}  # in the order in which they are painted


def build_rasters(town: Town, base_z: float) -> tuple[Raster, Raster, UInt8]:
    """Paints a town.

    Args:
        town: The town.
        base_z: Height of its plane [m].

    Returns:
        The raster of the plane, that of what is elevated, and the plane's classes (H, W) as
        `GRASS`, `ASPHALT`, …, by which scenery finds room.
    """
    points = town.lanes.points
    high = points[:, 2] - base_z > ELEVATED_M
    with ThreadPoolExecutor(1) as other:  # kernels hold no lock: two cores paint at a time
        deck = other.submit(_paint, town, high, points[high], CONCRETE)
        plane, classes = _paint(town, ~high, points, GRASS)
    return plane, deck.result()[0], classes


def _paint(town: Town, chosen: Bool, within: Float64, ground: int) -> tuple[Raster, UInt8]:
    lanes = town.lanes
    if within.size:
        origin = within[:, :2].min(axis=0) - MARGIN_M
        extent = within[:, :2].max(axis=0) + MARGIN_M - origin
    else:
        origin, extent = np.zeros(2), np.full(2, 1.0)
    columns, rows = (max(2, math.ceil(side / TEXEL_M)) for side in extent.tolist())
    classes = np.full((rows, columns), ground, np.uint8)
    for kind, class_ in _CLASS_OF_LANE.items():
        _fill_lanes(lanes, int(kind), chosen, origin, class_, classes)
    if ground == GRASS:
        pave_patches(classes, int(ISLAND_M2 / TEXEL_M**2), GRASS, ASPHALT)
    level = np.zeros((rows, columns), np.uint32)
    colour_classes(classes, _COLOURS, _GRAIN, _TAGS, _HOLDS_WATER, level)
    _draw_lines(lanes, chosen, origin, np.array([WHITE, YELLOW], np.float32), level)
    signals = town.signals
    for row, width in zip(signals.stop_pose, signals.stop_width_m, strict=True):
        if ground == GRASS or row[2] > ELEVATED_M:
            _bar(row, -STOP_LINE_M, 0.0, width / 2.0 - 0.1, origin, level)
    if ground == GRASS:
        for start, end, wide in zip(*town.crosswalks[:3], strict=True):
            _zebra(start, end, wide, origin, level)
    return with_levels(level, origin), classes


def _zebra(start: Float64, end: Float64, width_m: float, origin: Float64, level: UInt32) -> None:
    """Paints the bars of a crosswalk, from (2,) to (2,) across the road [m]."""
    along = end - start
    length = math.hypot(along[0], along[1])
    yaw = math.atan2(along[1], along[0])
    for k in range(int(length / (2.0 * BAR_M))):
        at = k * 2.0 * BAR_M + BAR_M / 2.0
        pose = np.array([*(start + along * (at / length)), yaw])
        _bar(pose, 0.0, BAR_M, width_m / 2.0, origin, level)


def _bar(
    pose: Float64, back_m: float, ahead_m: float, half_m: float, origin: Float64, level: UInt32
) -> None:
    """Paints the part of a white bar that lies on a road.

    Args:
        pose: (4,) x, y, z, yaw.
        back_m, ahead_m: Where it begins and ends along the yaw, from the pose.
        half_m: Half its width, across.
        origin: (2,) x, y of the raster's corner [m].
        level: (rows, columns) the finest texels, painted on.
    """
    middle = (back_m + ahead_m) / 2.0
    x = pose[0] + math.cos(pose[3]) * middle
    y = pose[1] + math.sin(pose[3]) * middle
    bar = Rectangle(float(x), float(y), float(pose[3]), (ahead_m - back_m) / 2.0, float(half_m))
    paint_rectangle(bar, origin, np.array(WHITE, np.float32), level)


@kernel
def _fill_lanes(
    lanes: Lanes, kind: int, chosen: Bool, origin: Float64, class_: int, classes: UInt8
) -> None:
    """Gives a class to all texels on lanes of a kind, along the chosen points.

    Args:
        lanes: Of the town.
        kind: `LaneKind`.
        chosen: (P,) which of the lanes' points count.
        origin: (2,) x, y of the raster's corner [m].
        class_: Of the ground.
        classes: (rows, columns) written.
    """
    for lane in range(lanes.kind.shape[0]):
        if lanes.kind[lane] != kind:
            continue
        for k in range(lanes.count[lane] - 1):
            p = lanes.first[lane] + k
            if not chosen[p]:
                continue
            ax, ay = lanes.points[p, 0], lanes.points[p, 1]
            bx, by = lanes.points[p + 1, 0], lanes.points[p + 1, 1]
            yaw = math.atan2(by - ay, bx - ax)
            half_length = 0.5 * math.hypot(bx - ax, by - ay) + _OVERLAP_M
            half_width = 0.5 * max(lanes.width_m[p], lanes.width_m[p + 1]) + 0.02
            piece = Rectangle(0.5 * (ax + bx), 0.5 * (ay + by), yaw, half_length, half_width)
            fill_rectangle(piece, origin, class_, classes)


@kernel
def _draw_lines(
    lanes: Lanes, chosen: Bool, origin: Float64, paints: Float32, level: UInt32
) -> None:
    """Draws lane lines outside junctions: broken where a change is allowed, yellow in the middle.

    A line between two lanes of one direction belongs to the left one. The leftmost edge of a
    direction is yellow; two directions side by side so have a double yellow line between them.

    Args:
        lanes: Of the town.
        chosen: (P,) which of the lanes' points count.
        origin: (2,) x, y of the raster's corner [m].
        paints: (2, 3) white and yellow, in levels.
        level: (rows, columns) the finest texels, painted on.
    """
    for lane in range(lanes.kind.shape[0]):
        if lanes.kind[lane] != _DRIVING or lanes.junction[lane] >= 0:
            continue
        for k in range(lanes.count[lane] - 1):
            p = lanes.first[lane] + k
            if not chosen[p]:
                continue
            right = lanes.right[lane] >= 0
            broken = right and lanes.change[p] & _MAY_CHANGE_RIGHT != 0
            if not broken or lanes.road_m[p] % DASH_EVERY_M < DASH_M:
                _line_piece(lanes, p, 1.0, 0.0 if right else LINE_INSET_M, origin, paints[0], level)
            if lanes.left[lane] < 0:
                _line_piece(lanes, p, -1.0, MIDDLE_INSET_M, origin, paints[1], level)


@kernel
def _line_piece(
    lanes: Lanes, p: int, side: float, inset: float, origin: Float64, paint: Float32, level: UInt32
) -> None:
    """Draws a line from point p of a lane to the next, beside its middle.

    Args:
        lanes: Of the town.
        p: The point.
        side: 1 on the right, -1 on the left.
        inset: How far inside the lane's edge [m].
        origin: (2,) x, y of the raster's corner [m].
        paint: (3,) in levels.
        level: (rows, columns) the finest texels, painted on.
    """
    a, b = lanes.points[p], lanes.points[p + 1]
    reach_a = side * (0.5 * lanes.width_m[p] - inset)
    reach_b = side * (0.5 * lanes.width_m[p + 1] - inset)
    ax, ay = a[0] - math.sin(a[3]) * reach_a, a[1] + math.cos(a[3]) * reach_a
    bx, by = b[0] - math.sin(b[3]) * reach_b, b[1] + math.cos(b[3]) * reach_b
    length = math.hypot(bx - ax, by - ay)
    if length > 0.0:
        yaw = math.atan2(by - ay, bx - ax)
        half_length = 0.5 * length + _OVERLAP_M
        line = Rectangle(0.5 * (ax + bx), 0.5 * (ay + by), yaw, half_length, 0.5 * LINE_M)
        paint_rectangle(line, origin, paint, level)
