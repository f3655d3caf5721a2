"""What a LiDAR hands out for its rays: points, intensities, dropped rays, noise, tags."""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, keyed_part, mix, normal
from di_envs.sensors.lidar.rays import GROUND, NONE
from di_envs.sensors.scene.boxes import Material
from di_envs.sensors.scene.surfaces import TEXEL_M
from di_envs.sensors.scene.tags import TAG_BITS, Tag

_KEYS = 1 << 27  # draws kept apart for each ego, more than a LiDAR can have rays
_DECK, _NO_TAG = int(Material.DECK), int(Tag.NONE)
_TAG_MASK = (1 << TAG_BITS) - 1
_LIDAR, _NOISE = int(Stream.LIDAR), int(Stream.LIDAR_NOISE)
F = np.float32


@kernel
def write_points(sweep, ego, points):
    """Writes points and intensities; drops rays and adds noise by keyed draws."""
    state, numbers = sweep.state, sweep.numbers
    first, channels = sweep.scan[0], sweep.distance.shape[1]
    seed, tick, key = state.seed[()], state.tick[()], np.uint64(ego) * np.uint64(_KEYS)
    part = keyed_part(seed, _LIDAR, tick)
    drops = numbers[5] > 0.0 or numbers[7] > 0.0
    least, slope = 1.0 - numbers[7], numbers[7] / max(numbers[6], 1e-9)
    x, y, z = F(numbers[0]), F(numbers[1]), F(numbers[2])
    for step in range(first, sweep.scan[1]):
        ca, sa = sweep.turn[step, 0], sweep.turn[step, 1]
        for channel in range(channels):
            far = sweep.distance[step, channel]
            kept = np.float64(far) <= numbers[3]
            intensity = 0.0
            if kept:
                intensity = math.exp(-numbers[4] * np.float64(far))
            ray = key + np.uint64(step * channels + channel)
            if kept and drops:
                draw = mix(part ^ ray)  # its halves are two independent draws
                back = float(draw >> np.uint64(32)) * 2.0**-32 >= numbers[5]
                second = float(draw & np.uint64(0xFFFFFFFF)) * 2.0**-32
                kept = back and (intensity > numbers[6] or second < slope * intensity + least)
            if not kept:
                sweep.hit[step, channel] = NONE
                for k in range(4):
                    points[step - first, channel, k] = F(0.0)
                continue
            if numbers[8] > 0.0:
                noisy = np.float64(far) + numbers[8] * normal(seed, _NOISE, tick, ray)
                far = F(min(max(noisy, 0.0), numbers[3]))
            over_ground = far * sweep.cosine[channel]
            points[step - first, channel, 0] = over_ground * ca + x
            points[step - first, channel, 1] = over_ground * sa + y
            points[step - first, channel, 2] = far * sweep.sine[channel] + z
            points[step - first, channel, 3] = F(intensity)


@kernel
def write_tags(sweep, x, y, z, c, s, points, tags):
    """Writes what was hit; on the ground and on decks by their rasters."""
    scene, boxes = sweep.scene, sweep.boxes
    first, channels = sweep.scan[0], sweep.distance.shape[1]
    for step in range(first, sweep.scan[1]):
        ca, sa = np.float64(sweep.turn[step, 0]), np.float64(sweep.turn[step, 1])
        wx, wy = c * ca - s * sa, s * ca + c * sa
        for channel in range(channels):
            hit = sweep.hit[step, channel]
            if hit == NONE:
                tags[step - first, channel] = _NO_TAG
                continue
            far = np.float64(sweep.distance[step, channel])
            flat = far * np.float64(sweep.cosine[channel])
            px, py = x + flat * wx, y + flat * wy
            if hit == GROUND:
                tags[step - first, channel] = _tag_at(scene.ground, px, py)
                continue
            tags[step - first, channel] = boxes.tag[hit]
            if boxes.material[hit] == _DECK:
                pz = z + far * np.float64(sweep.sine[channel])
                if _on_top(boxes, hit, px, py, pz):
                    tags[step - first, channel] = _tag_at(scene.deck, px, py)


@kernel
def _tag_at(raster, x, y):
    """The tag of a raster's texel at a place; beyond its edge that of the nearest one."""
    column = int((x - raster.origin[0]) / TEXEL_M)
    row = int((y - raster.origin[1]) / TEXEL_M)
    column = min(max(column, 0), raster.width[0] - 1)
    row = min(max(row, 0), raster.height[0] - 1)
    texel = raster.texels[raster.start[0] + row * raster.width[0] + column]
    return np.uint8((texel >> np.uint32(24)) & np.uint32(_TAG_MASK))


@kernel
def _on_top(boxes, box, x, y, z):
    """Whether a point on a box lies on its upper face."""
    yaw, pitch = np.float64(boxes.yaw[box]), np.float64(boxes.pitch[box])
    dx, dy, dz = x - boxes.centre[box, 0], y - boxes.centre[box, 1], z - boxes.centre[box, 2]
    ahead = math.cos(yaw) * dx + math.sin(yaw) * dy
    up = math.cos(pitch) * dz - math.sin(pitch) * ahead
    return up > boxes.half[box, 2] - 0.02
