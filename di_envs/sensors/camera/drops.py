"""What is drawn over a finished image: the glow of lamps, and rain."""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.arrays import Float32, UInt8
from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import keyed_hash
from di_envs.sensors.camera.projection import Camera, Projected
from di_envs.sensors.scene.boxes import Boxes, Material
from di_envs.world.state import State

BLOOM_PX = 0.85  # least radius of a shining lamp: what is half a pixel wide is seen all the same
FADE_M = 160.0  # where a lamp is no longer seen; it fades from half of that on
_LAMP = int(Material.LAMP)
_RAIN = 15  # Stream.RAIN, as a plain number for kernels
_STREAKS = 1.0 / 700.0  # of pixels, in the hardest rain


@kernel
def add_glow(boxes: Boxes, seen: Projected, cam: Camera, depth: Float32, rgb: UInt8) -> None:
    """Draws every lamp that is seen as a disc of at least `BLOOM_PX`, with a faint halo.

    Args:
        boxes: What was collected round the ego.
        seen: Which of them the camera sees.
        cam: In its place.
        depth: (H, W) of the image [m].
        rgb: (H, 3 W) the image, drawn on.
    """
    height, width = depth.shape
    eye, axes = cam.eye, cam.axes
    for k in range(seen.count[0]):
        b = seen.source[k]
        if boxes.material[b] != _LAMP:
            continue
        dx, dy = boxes.centre[b, 0] - eye[0], boxes.centre[b, 1] - eye[1]
        dz = boxes.centre[b, 2] - eye[2]
        if dx * math.cos(boxes.yaw[b]) + dy * math.sin(boxes.yaw[b]) <= 0.0:
            continue  # it shines the other way: its housing, thin as it is, hides it
        ahead = dx * axes[0, 0] + dy * axes[0, 1] + dz * axes[0, 2]
        if ahead < 0.5:
            continue
        right = dx * axes[1, 0] + dy * axes[1, 1]  # the camera does not roll
        down = dx * axes[2, 0] + dy * axes[2, 1] + dz * axes[2, 2]
        x = cam.cx_px + cam.focal_px * right / ahead
        y = cam.cy_px + cam.focal_px * down / ahead
        column, row = math.floor(x), math.floor(y)
        if not (0 <= column < width and 0 <= row < height):
            continue
        if depth[row, column] < ahead - 0.35:
            continue
        size = np.float64(min(boxes.half[b, 1], boxes.half[b, 2])) * cam.focal_px / ahead
        share = min(1.0, max(0.0, (FADE_M - ahead) / (0.5 * FADE_M)))
        _disc(x, y, size, share, boxes.colour[b], rgb)


@kernel
def _disc(x: float, y: float, size: float, strength: float, colour: Float32, rgb: UInt8) -> None:
    """Blends a disc of light and its halo into an image.

    Args:
        x, y: Its middle [px].
        size: Its radius [px].
        strength: 0..1.
        colour: (3,) what it shines, 0..1.
        rgb: (H, 3 W) the image.
    """
    radius = max(size, BLOOM_PX)
    halo = max(radius + 0.6, 2.0 * size)
    height, width = rgb.shape[0], rgb.shape[1] // 3
    for row in range(max(0, int(y - halo)), min(height, int(y + halo) + 1)):
        for column in range(max(0, int(x - halo)), min(width, int(x + halo) + 1)):
            off = math.hypot(column + 0.5 - x, row + 0.5 - y)
            core = min(max(radius + 0.5 - off, 0.0), 1.0)
            glow = max(0.0, 1.0 - off / halo)
            share = strength * max(core, 0.45 * glow * glow)
            for q in range(3):
                old = np.float64(rgb[row, 3 * column + q])
                new = old + share * (255.0 * colour[q] - old)
                rgb[row, 3 * column + q] = np.uint8(min(max(new, 0.0), 255.0))


@kernel
def add_rain(state: State, key: int, rain: float, rgb: UInt8) -> None:
    """Draws streaks of rain, other ones in every tick and camera.

    Args:
        state: Of the world: its seed and tick count.
        key: The camera's own.
        rain: How hard it rains, 0..1.
        rgb: (H, 3 W) the image, drawn on.
    """
    height, width = rgb.shape[0], rgb.shape[1] // 3
    for drop in range(int(rain * width * height * _STREAKS * min(1.0, 400.0 / height))):
        draw = keyed_hash(state.seed[()], _RAIN, state.tick[()], key * 1000000 + drop)
        x = float(draw & np.uint64(0xFFFF)) / 65536.0 * width
        y = float((draw >> np.uint64(16)) & np.uint64(0xFFFF)) / 65536.0 * height
        near = float((draw >> np.uint64(32)) & np.uint64(0xFF)) / 256.0
        length = max(2.0, (0.02 + 0.06 * near) * height)
        share = 0.12 + 0.22 * near
        slant = 0.12 * (x / width - 0.5)
        for step in range(int(length)):
            row, column = int(y) + step, int(x + slant * step)
            if 0 <= row < height and 0 <= column < width:
                for q in range(3):
                    old = np.float64(rgb[row, 3 * column + q])
                    rgb[row, 3 * column + q] = np.uint8(old + share * (205.0 - old))
