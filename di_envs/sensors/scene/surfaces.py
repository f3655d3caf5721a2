"""The ground as a raster of colours and tags: lanes, lines, stop lines, crosswalks, grass.

Two rasters make a town: one for what lies on its plane, one for what is elevated (the tops of
decks). A texel is 4 bytes: red, green, blue, and a byte of `Tag` (5 bits) and how low the place
lies (3 bits, for puddles). Below each raster lie coarser ones, every one the mean of 2 x 2 texels
of the one above, so that what is far away is an average and does not crawl.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import keyed_hash, uniform
from di_envs.sensors.scene.tags import TAG_BITS, Tag
from di_envs.town.lanes import LaneKind
from di_envs.town.town import Town

TEXEL_M = 0.16
MARGIN_M = 24.0  # of grass round the town
LEVELS = 8
ELEVATED_M = 0.05  # above the plane from which a lane is on a deck
LINE_M = 0.15  # width of a lane line
LINE_INSET_M = 0.12  # of its middle from the lane's edge
MIDDLE_INSET_M = 0.18  # alike for the yellow line, two of which side by side stay two
DASH_M, DASH_EVERY_M = 3.0, 9.0
STOP_LINE_M = 0.4
BAR_M = 0.5  # width of a crosswalk's bars, and of the gaps between
ISLAND_M2 = 60.0  # grass enclosed by lanes of a junction is paved up to this size
_COARSE = 4  # texels between the places at which slow variation is drawn
_SCENERY = 14  # Stream.SCENERY, as a plain number for kernels

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
_CLASS_OF_LANE = {
    LaneKind.SIDEWALK: PAVEMENT,
    LaneKind.OTHER: KERB,
    LaneKind.SHOULDER: SHOULDER,
    LaneKind.PARKING: SHOULDER,
    LaneKind.BIKING: SHOULDER,
    LaneKind.DRIVING: ASPHALT,
}  # in the order in which they are painted


@by_reference
class Raster(NamedTuple):
    """A raster and its coarser levels, one after the other in one array."""

    texels: NDArray[np.uint32]  # (N,)
    start: NDArray[np.int64]  # (LEVELS,) first texel of a level
    width: NDArray[np.int64]  # (LEVELS,) texels in x
    height: NDArray[np.int64]  # (LEVELS,) texels in y
    origin: NDArray[np.float64]  # (2,) x, y of the corner [m]


def build_rasters(town: Town, base_z: float) -> tuple[Raster, Raster, NDArray[np.uint8]]:
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
    plane, classes = _paint(town, ~high, points, GRASS)
    if high.any():
        deck, _ = _paint(town, high, points[high], CONCRETE)
    else:
        deck, _ = _paint(town, high, points[:0], CONCRETE)
    return plane, deck, classes


def _paint(
    town: Town, chosen: NDArray[np.bool_], within: NDArray[np.float64], ground: int
) -> tuple[Raster, NDArray[np.uint8]]:
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
        _pave_islands(classes, int(ISLAND_M2 / TEXEL_M**2), GRASS, ASPHALT)
    level = np.zeros((rows, columns), np.uint32)
    _colour(classes, _COLOURS, _GRAIN, _TAGS, level)
    _draw_lines(lanes, chosen, origin, np.array([WHITE, YELLOW], np.float32), level)
    signals = town.signals
    for row, width in zip(signals.stop_pose, signals.stop_width_m, strict=True):
        if ground == GRASS or row[2] > ELEVATED_M:
            _bar(row, -STOP_LINE_M, 0.0, width / 2.0 - 0.1, origin, WHITE, level)
    if ground == GRASS:
        for start, end, wide in zip(*town.crosswalks[:3], strict=True):
            _zebra(start, end, wide, origin, level)
    return _with_levels(level, origin), classes


def _zebra(start, end, width_m, origin, level) -> None:
    along = end - start
    length = math.hypot(along[0], along[1])
    yaw = math.atan2(along[1], along[0])
    for k in range(int(length / (2.0 * BAR_M))):
        at = k * 2.0 * BAR_M + BAR_M / 2.0
        pose = np.array([*(start + along * (at / length)), yaw])
        _bar(pose, 0.0, BAR_M, width_m / 2.0, origin, WHITE, level)


def _bar(pose, back_m, ahead_m, half_m, origin, colour, level) -> None:
    """Paints the part of a rectangle that lies on a road."""
    middle = (back_m + ahead_m) / 2.0
    x = pose[0] + math.cos(pose[3]) * middle
    y = pose[1] + math.sin(pose[3]) * middle
    paint = np.array(colour, np.float32)
    _stroke(x, y, pose[3], (ahead_m - back_m) / 2.0, half_m, origin, paint, level)


def _with_levels(level: NDArray[np.uint32], origin: NDArray[np.float64]) -> Raster:
    levels = [level]
    while len(levels) < LEVELS:
        rows, columns = levels[-1].shape
        smaller = np.zeros((max(1, (rows + 1) // 2), max(1, (columns + 1) // 2)), np.uint32)
        _halve(levels[-1], smaller)
        levels.append(smaller)
    sizes = [part.size for part in levels]
    return Raster(
        texels=np.concatenate([part.ravel() for part in levels]),
        start=np.cumsum([0, *sizes[:-1]]).astype(np.int64),
        width=np.array([part.shape[1] for part in levels], np.int64),
        height=np.array([part.shape[0] for part in levels], np.int64),
        origin=origin.astype(np.float64),
    )


@kernel
def _fill_lanes(lanes, kind, chosen, origin, class_, classes):
    """Gives a class to all texels on lanes of a kind, along the chosen points."""
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
            half_length = 0.5 * math.hypot(bx - ax, by - ay) + 0.08
            half_width = 0.5 * max(lanes.width_m[p], lanes.width_m[p + 1]) + 0.02
            x, y = 0.5 * (ax + bx), 0.5 * (ay + by)
            _fill(x, y, yaw, half_length, half_width, origin, class_, classes)


@kernel
def _fill(x, y, yaw, half_length, half_width, origin, class_, classes):
    """Gives a class to the texels whose middles lie in a rectangle."""
    c, s = math.cos(yaw), math.sin(yaw)
    reach_x = abs(c) * half_length + abs(s) * half_width
    reach_y = abs(s) * half_length + abs(c) * half_width
    for row in range(
        max(0, int((y - reach_y - origin[1]) / TEXEL_M)),
        min(classes.shape[0], int((y + reach_y - origin[1]) / TEXEL_M) + 1),
    ):
        dy = origin[1] + (row + 0.5) * TEXEL_M - y
        for column in range(
            max(0, int((x - reach_x - origin[0]) / TEXEL_M)),
            min(classes.shape[1], int((x + reach_x - origin[0]) / TEXEL_M) + 1),
        ):
            dx = origin[0] + (column + 0.5) * TEXEL_M - x
            if abs(c * dx + s * dy) <= half_length and abs(c * dy - s * dx) <= half_width:
                classes[row, column] = class_


@kernel
def _pave_islands(classes, limit, ground, paving):
    """Paves patches of ground of at most `limit` texels, as between the lanes of a junction."""
    rows, columns = classes.shape
    seen = np.zeros((rows, columns), np.bool_)
    queue = np.zeros(rows * columns, np.int32)
    for start in range(rows * columns):
        if seen[start // columns, start % columns]:
            continue
        if classes[start // columns, start % columns] != ground:
            continue
        queue[0] = start
        seen[start // columns, start % columns] = True
        head, tail = 0, 1
        while head < tail:
            row, column = queue[head] // columns, queue[head] % columns
            head += 1
            for side in range(4):
                i = row + (1 if side == 0 else (-1 if side == 1 else 0))
                j = column + (1 if side == 2 else (-1 if side == 3 else 0))
                inside = 0 <= i < rows and 0 <= j < columns
                if inside and not seen[i, j] and classes[i, j] == ground:
                    seen[i, j] = True
                    queue[tail] = i * columns + j
                    tail += 1
        if tail <= limit:
            for k in range(tail):
                classes[queue[k] // columns, queue[k] % columns] = paving


@kernel
def _smooth(column, row, cell):
    """A number in [0, 1) that varies smoothly over some `cell` texels."""
    i, j = column // cell, row // cell
    u, v = (column - i * cell) / cell, (row - j * cell) / cell
    u, v = u * u * (3.0 - 2.0 * u), v * v * (3.0 - 2.0 * v)
    near = uniform(0, _SCENERY, i, j) * (1.0 - u) + uniform(0, _SCENERY, i + 1, j) * u
    far = uniform(0, _SCENERY, i, j + 1) * (1.0 - u) + uniform(0, _SCENERY, i + 1, j + 1) * u
    return near * (1.0 - v) + far * v


@kernel
def _pack(r, g, b, last):
    return (
        np.uint32(min(max(r, 0.0), 255.0))
        | (np.uint32(min(max(g, 0.0), 255.0)) << np.uint32(8))
        | (np.uint32(min(max(b, 0.0), 255.0)) << np.uint32(16))
        | (np.uint32(last) << np.uint32(24))
    )


@kernel
def _colour(classes, colours, grain, tags, level):
    """Colours classes, with a grain and slow variation, and says how low each road texel lies."""
    rows, columns = classes.shape
    coarse = np.zeros((rows // _COARSE + 2, columns // _COARSE + 2, 2))
    for i in range(coarse.shape[0]):
        for j in range(coarse.shape[1]):
            coarse[i, j, 0] = _smooth(j * _COARSE, i * _COARSE, 24) - 0.5
            fine = _smooth(j * _COARSE + 9000, i * _COARSE, 9)
            coarse[i, j, 1] = 8.0 * (0.5 * coarse[i, j, 0] + 0.25 + 0.5 * fine)
    for i in range(rows):
        k, v = i // _COARSE, (i % _COARSE) / _COARSE
        for j in range(columns):
            m, u = j // _COARSE, (j % _COARSE) / _COARSE
            class_ = classes[i, j]
            slow = _between(coarse[k, m, 0], coarse[k, m + 1, 0],
                            coarse[k + 1, m, 0], coarse[k + 1, m + 1, 0], u, v)  # fmt: skip
            low = 0
            if class_ == 1 or class_ == 2:
                low = int(_between(coarse[k, m, 1], coarse[k, m + 1, 1],
                                   coarse[k + 1, m, 1], coarse[k + 1, m + 1, 1], u, v))  # fmt: skip
            noise = float(keyed_hash(1, _SCENERY, i, j) & np.uint64(255)) / 255.0 - 0.5
            add = grain[class_] * (noise + 0.7 * slow)
            level[i, j] = _pack(
                colours[class_, 0] + add,
                colours[class_, 1] + add,
                colours[class_, 2] + add,
                tags[class_] | (min(max(low, 0), 7) << TAG_BITS),
            )


@kernel
def _between(a, b, c, d, u, v):
    """Between four corners."""
    return (a * (1.0 - u) + b * u) * (1.0 - v) + (c * (1.0 - u) + d * u) * v


@kernel
def _stroke(x, y, yaw, half_length, half_width, origin, paint, level):
    """Blends a rectangle of paint onto road texels by how much of each it covers."""
    c, s = math.cos(yaw), math.sin(yaw)
    grown = TEXEL_M
    reach_x = abs(c) * (half_length + grown) + abs(s) * (half_width + grown)
    reach_y = abs(s) * (half_length + grown) + abs(c) * (half_width + grown)
    for row in range(
        max(0, int((y - reach_y - origin[1]) / TEXEL_M)),
        min(level.shape[0], int((y + reach_y - origin[1]) / TEXEL_M) + 1),
    ):
        dy = origin[1] + (row + 0.5) * TEXEL_M - y
        for column in range(
            max(0, int((x - reach_x - origin[0]) / TEXEL_M)),
            min(level.shape[1], int((x + reach_x - origin[0]) / TEXEL_M) + 1),
        ):
            dx = origin[0] + (column + 0.5) * TEXEL_M - x
            across = (half_width - abs(c * dy - s * dx)) / TEXEL_M + 0.5
            along = (half_length - abs(c * dx + s * dy)) / TEXEL_M + 0.5
            cover = min(max(across, 0.0), 1.0) * min(max(along, 0.0), 1.0)
            old = level[row, column]
            tag = (old >> np.uint32(24)) & np.uint32(31)
            if cover <= 0.0 or not (tag == 1 or tag == 24):
                continue
            r = np.float64(old & np.uint32(255))
            g = np.float64((old >> np.uint32(8)) & np.uint32(255))
            b = np.float64((old >> np.uint32(16)) & np.uint32(255))
            last = old >> np.uint32(24)
            if cover > 0.4:
                last = (last & np.uint32(224)) | np.uint32(24)
            level[row, column] = _pack(
                r + max(0.0, cover * (paint[0] - r)),
                g + max(0.0, cover * (paint[1] - g)),
                b + (cover * (paint[2] - b)),
                last,
            )


@kernel
def _draw_lines(lanes, chosen, origin, paints, level):
    """Draws lane lines outside junctions: broken where a change is allowed, yellow in the middle.

    A line between two lanes of one direction belongs to the left one. The leftmost edge of a
    direction is yellow; two directions side by side so have a double yellow line between them.
    """
    for lane in range(lanes.kind.shape[0]):
        if lanes.kind[lane] != 1 or lanes.junction[lane] >= 0:
            continue
        for k in range(lanes.count[lane] - 1):
            p = lanes.first[lane] + k
            if not chosen[p]:
                continue
            right = lanes.right[lane] >= 0
            broken = right and lanes.change[p] & 2 != 0
            if not broken or lanes.road_m[p] % DASH_EVERY_M < DASH_M:
                _line_piece(lanes, p, 1.0, 0.0 if right else LINE_INSET_M, origin, paints[0], level)
            if lanes.left[lane] < 0:
                _line_piece(lanes, p, -1.0, MIDDLE_INSET_M, origin, paints[1], level)


@kernel
def _line_piece(lanes, p, side, inset, origin, paint, level):
    """Draws a line from one point of a lane to the next, beside its middle."""
    a, b = lanes.points[p], lanes.points[p + 1]
    reach_a = side * (0.5 * lanes.width_m[p] - inset)
    reach_b = side * (0.5 * lanes.width_m[p + 1] - inset)
    ax, ay = a[0] - math.sin(a[3]) * reach_a, a[1] + math.cos(a[3]) * reach_a
    bx, by = b[0] - math.sin(b[3]) * reach_b, b[1] + math.cos(b[3]) * reach_b
    length = math.hypot(bx - ax, by - ay)
    if length > 0.0:
        yaw = math.atan2(by - ay, bx - ax)
        x, y = 0.5 * (ax + bx), 0.5 * (ay + by)
        _stroke(x, y, yaw, 0.5 * length + 0.08, 0.5 * LINE_M, origin, paint, level)


@kernel
def _halve(fine, coarse):
    """Averages 2 x 2 texels' colours; the tag is that of one of them, in turns."""
    rows, columns = fine.shape
    for row in range(coarse.shape[0]):
        for column in range(coarse.shape[1]):
            r, g, b = 0.0, 0.0, 0.0
            for k in range(4):
                texel = fine[min(2 * row + k // 2, rows - 1), min(2 * column + k % 2, columns - 1)]
                r += np.float64(texel & np.uint32(255))
                g += np.float64((texel >> np.uint32(8)) & np.uint32(255))
                b += np.float64((texel >> np.uint32(16)) & np.uint32(255))
            pick = fine[
                min(2 * row + (column & 1), rows - 1), min(2 * column + (row & 1), columns - 1)
            ]
            coarse[row, column] = _pack(
                0.25 * r + 0.5, 0.25 * g + 0.5, 0.25 * b + 0.5, pick >> np.uint32(24)
            )
