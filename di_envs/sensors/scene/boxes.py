"""Boxes: what stands on the ground, as arrays that cameras and LiDAR read alike.

A box is turned by its yaw and then tilted by its pitch (positive lifts its front, for decks of
ramps). World frame, metres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.sensors.scene.tags import Tag


class Material(IntEnum):
    """How a box's faces look; its shape is the same whatever it is made of."""

    PLAIN = 0
    WINDOWS = 1  # rows of windows on its sides
    DECK = 2  # its top shows the raster of what is elevated
    FOLIAGE = 3
    LAMP = 4  # shines by itself, and blooms


@by_reference
class Boxes(NamedTuple):
    """Room for B boxes; those before `count[0]` are there."""

    count: NDArray[np.int64]  # type: ignore[assignment]  # (1,)
    centre: NDArray[np.float64]  # (B, 3) x, y, z of the middle
    yaw: NDArray[np.float32]  # (B,) rad
    turn: NDArray[np.float64]  # (B, 2) cosine and sine of the yaw
    pitch: NDArray[np.float32]  # (B,) rad
    half: NDArray[np.float32]  # (B, 3) half length, width, height [m]
    colour: NDArray[np.float32]  # (B, 3) reflectance 0..1; of lamps, what they shine
    tag: NDArray[np.uint8]  # (B,) Tag
    material: NDArray[np.uint8]  # (B,) Material
    instance: NDArray[np.int32]  # (B,) actor id + 1, 0 for what never moves


@dataclass(frozen=True, kw_only=True)
class BoxSpec:
    """One static box, as the builders of scenery write it down."""

    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    yaw: float = 0.0
    pitch: float = 0.0
    colour: tuple[float, float, float] = (0.5, 0.5, 0.5)
    tag: Tag = Tag.STATIC
    material: Material = Material.PLAIN


def empty_boxes(room: int) -> Boxes:
    """Boxes with room for so many, none of them there."""
    return Boxes(
        count=np.zeros(1, np.int64),
        centre=np.zeros((room, 3)),
        yaw=np.zeros(room, np.float32),
        turn=np.zeros((room, 2)),
        pitch=np.zeros(room, np.float32),
        half=np.zeros((room, 3), np.float32),
        colour=np.zeros((room, 3), np.float32),
        tag=np.zeros(room, np.uint8),
        material=np.zeros(room, np.uint8),
        instance=np.zeros(room, np.int32),
    )


def boxes_of(specs: Sequence[BoxSpec]) -> Boxes:
    """The arrays of a list of boxes."""
    boxes = empty_boxes(len(specs))
    boxes.count[0] = len(specs)
    for row, spec in enumerate(specs):
        boxes.centre[row], boxes.half[row], boxes.colour[row] = spec.centre, spec.half, spec.colour
        boxes.pitch[row] = spec.pitch
        turn_box(boxes, row, spec.yaw)
        boxes.tag[row], boxes.material[row] = spec.tag, spec.material
    return boxes


@kernel
def turn_box(boxes: Boxes, row: int, yaw: float) -> None:
    """Writes how a box is turned [rad]."""
    boxes.yaw[row] = yaw
    kept = np.float64(boxes.yaw[row])
    boxes.turn[row, 0], boxes.turn[row, 1] = math.cos(kept), math.sin(kept)


@kernel
def copy_box(source: Boxes, row: int, target: Boxes) -> None:
    """Appends a box to others; one that finds no room is left out."""
    at = target.count[0]
    if at >= target.yaw.shape[0]:
        return
    for axis in range(3):
        target.centre[at, axis] = source.centre[row, axis]
        target.half[at, axis] = source.half[row, axis]
        target.colour[at, axis] = source.colour[row, axis]
    target.yaw[at] = source.yaw[row]
    target.turn[at, 0], target.turn[at, 1] = source.turn[row, 0], source.turn[row, 1]
    target.pitch[at] = source.pitch[row]
    target.tag[at] = source.tag[row]
    target.material[at] = source.material[row]
    target.instance[at] = source.instance[row]
    target.count[0] = at + 1
