"""A raster of the ground: its texels, its coarser levels, and how rectangles are painted on it.

A texel is 4 bytes: red, green, blue, and a byte of `Tag` (5 bits) and how low the place lies (3
bits, for puddles). Below each raster lie coarser ones, every one the mean of 2 x 2 texels of the
one above, so that what is far away is an average and does not crawl.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Float32, Float64, Int64, UInt8, UInt32
from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.sensors.scene.tags import TAG_BITS, Tag

TEXEL_M = 0.16
LEVELS = 8
_ROADS, _ROAD_LINES = int(Tag.ROADS), int(Tag.ROAD_LINES)
_TAG_MASK = (1 << TAG_BITS) - 1
_LOWNESS_MASK = 255 - _TAG_MASK  # of a texel's last byte
_MARKED = 0.4  # share of a texel that paint has to cover to make it a line's


@by_reference
class Raster(NamedTuple):
    """A raster and its coarser levels, one after the other in one array."""

    texels: UInt32  # (N,)
    start: Int64  # (LEVELS,) first texel of a level
    width: Int64  # (LEVELS,) texels in x
    height: Int64  # (LEVELS,) texels in y
    origin: Float64  # (2,) x, y of the corner [m]


class Rectangle(NamedTuple):
    """A rectangle on the ground, in the world frame."""

    x: float  # its middle [m]
    y: float
    yaw: float
    half_length: float  # along its yaw [m]
    half_width: float


def with_levels(level: UInt32, origin: Float64) -> Raster:
    """A raster of which (rows, columns) the finest level is known."""
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
def pack(r: float, g: float, b: float, last: int | np.uint32) -> np.uint32:
    """A texel of a colour in levels, which is clipped to bytes, and its last byte."""
    return (
        np.uint32(min(max(r, 0.0), 255.0))
        | (np.uint32(min(max(g, 0.0), 255.0)) << np.uint32(8))
        | (np.uint32(min(max(b, 0.0), 255.0)) << np.uint32(16))
        | (np.uint32(last) << np.uint32(24))
    )


@kernel
def _halve(fine: UInt32, coarse: UInt32) -> None:
    """Averages 2 x 2 texels' colours; the tag is that of one of them, in turns.

    Args:
        fine: (rows, columns) of a level.
        coarse: Half of that, rounded up: written.
    """
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
            coarse[row, column] = pack(
                0.25 * r + 0.5, 0.25 * g + 0.5, 0.25 * b + 0.5, pick >> np.uint32(24)
            )


@kernel
def _near(
    place: Rectangle, grown: float, origin: Float64, rows: int, columns: int
) -> tuple[int, int, int, int]:
    """First and end row, first and end column of the texels round a rectangle, `grown` [m]."""
    c, s = abs(math.cos(place.yaw)), abs(math.sin(place.yaw))
    reach_x = c * (place.half_length + grown) + s * (place.half_width + grown)
    reach_y = s * (place.half_length + grown) + c * (place.half_width + grown)
    return (
        max(0, int((place.y - reach_y - origin[1]) / TEXEL_M)),
        min(rows, int((place.y + reach_y - origin[1]) / TEXEL_M) + 1),
        max(0, int((place.x - reach_x - origin[0]) / TEXEL_M)),
        min(columns, int((place.x + reach_x - origin[0]) / TEXEL_M) + 1),
    )


@kernel
def fill_rectangle(place: Rectangle, origin: Float64, class_: int, classes: UInt8) -> None:
    """Gives a class to the texels whose middles lie in a rectangle.

    Args:
        place: The rectangle.
        origin: (2,) x, y of the raster's corner [m].
        class_: Of its ground.
        classes: (rows, columns) written.
    """
    c, s = math.cos(place.yaw), math.sin(place.yaw)
    low, end, left, right = _near(place, 0.0, origin, classes.shape[0], classes.shape[1])
    for row in range(low, end):
        dy = origin[1] + (row + 0.5) * TEXEL_M - place.y
        for column in range(left, right):
            dx = origin[0] + (column + 0.5) * TEXEL_M - place.x
            along, across = abs(c * dx + s * dy), abs(c * dy - s * dx)
            if along <= place.half_length and across <= place.half_width:
                classes[row, column] = class_


@kernel
def paint_rectangle(place: Rectangle, origin: Float64, paint: Float32, level: UInt32) -> None:
    """Blends a rectangle of paint onto road texels by how much of each it covers.

    Args:
        place: The rectangle.
        origin: (2,) x, y of the raster's corner [m].
        paint: (3,) its colour, in levels.
        level: (rows, columns) the finest texels, painted on.
    """
    c, s = math.cos(place.yaw), math.sin(place.yaw)
    low, end, left, right = _near(place, TEXEL_M, origin, level.shape[0], level.shape[1])
    for row in range(low, end):
        dy = origin[1] + (row + 0.5) * TEXEL_M - place.y
        for column in range(left, right):
            dx = origin[0] + (column + 0.5) * TEXEL_M - place.x
            across = (place.half_width - abs(c * dy - s * dx)) / TEXEL_M + 0.5
            along = (place.half_length - abs(c * dx + s * dy)) / TEXEL_M + 0.5
            cover = min(max(across, 0.0), 1.0) * min(max(along, 0.0), 1.0)
            if cover > 0.0:
                level[row, column] = _painted(level[row, column], cover, paint)


@kernel
def _painted(texel: np.uint32, cover: float, paint: Float32) -> np.uint32:
    """A texel, a share of which is covered by paint; what is no road stays as it is."""
    tag = (texel >> np.uint32(24)) & np.uint32(_TAG_MASK)
    if tag != _ROADS and tag != _ROAD_LINES:
        return texel
    r = np.float64(texel & np.uint32(255))
    g = np.float64((texel >> np.uint32(8)) & np.uint32(255))
    b = np.float64((texel >> np.uint32(16)) & np.uint32(255))
    last = texel >> np.uint32(24)
    if cover > _MARKED:
        last = (last & np.uint32(_LOWNESS_MASK)) | np.uint32(_ROAD_LINES)
    return pack(
        r + max(0.0, cover * (paint[0] - r)),
        g + max(0.0, cover * (paint[1] - g)),
        b + (cover * (paint[2] - b)),
        last,
    )
