"""What a LiDAR hands out for its rays: points, intensities, dropped rays, noise, tags."""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.arrays import Float32, UInt8
from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, keyed_part, mix, normal
from di_envs.sensors.lidar.rays import GROUND, NONE, Sweep
from di_envs.sensors.lidar.window import LidarPose
from di_envs.sensors.scene.boxes import Boxes, Material
from di_envs.sensors.scene.raster import TEXEL_M, Raster
from di_envs.sensors.scene.tags import TAG_BITS, Tag

_KEYS = 1 << 27  # draws kept apart for each ego, more than a LiDAR can have rays
_DECK, _NO_TAG = int(Material.DECK), int(Tag.NONE)
_TAG_MASK = (1 << TAG_BITS) - 1
_LIDAR, _NOISE = int(Stream.LIDAR), int(Stream.LIDAR_NOISE)
F = np.float32


@kernel
def write_points(sweep: Sweep, ego: int, points: Float32) -> None:
    """Writes points and intensities; drops rays and adds noise by keyed draws.

    Args:
        sweep: Its distances are known; `hit` becomes `NONE` for rays that are dropped.
        ego: The ego's index.
        points: (K, C, 4) written: x, y, z [m] in the ego's frame and intensity 0..1, or zeros.
    """
    state, range_m, noise_m = sweep.state, sweep.range_m, sweep.noise_m
    first, channels = sweep.scan[0], sweep.distance.shape[1]
    seed, tick, key = state.seed[()], state.tick[()], np.uint64(ego) * np.uint64(_KEYS)
    part = keyed_part(seed, _LIDAR, tick)
    lost, faint, faint_lost = sweep.dropoff, sweep.dropoff_intensity, sweep.dropoff_zero
    drops = lost > 0.0 or faint_lost > 0.0
    least, slope = 1.0 - faint_lost, faint_lost / max(faint, 1e-9)
    x, y, z = F(sweep.x_m), F(sweep.y_m), F(sweep.z_m)
    for step in range(first, sweep.scan[1]):
        ca, sa = sweep.turn[step, 0], sweep.turn[step, 1]
        for channel in range(channels):
            far = sweep.distance[step, channel]
            kept = bool(np.float64(far) <= range_m)
            intensity = 0.0
            if kept:
                intensity = math.exp(-sweep.attenuation_per_m * np.float64(far))
            ray = key + np.uint64(step * channels + channel)
            if kept and drops:
                draw = mix(part ^ ray)  # its halves are two independent draws
                back = float(draw >> np.uint64(32)) * 2.0**-32 >= lost
                second = float(draw & np.uint64(0xFFFFFFFF)) * 2.0**-32
                kept = back and (intensity > faint or second < slope * intensity + least)
            if not kept:
                sweep.hit[step, channel] = NONE
                for k in range(4):
                    points[step - first, channel, k] = F(0.0)
                continue
            if noise_m > 0.0:
                noisy = np.float64(far) + noise_m * normal(seed, _NOISE, tick, ray)
                far = F(min(max(noisy, 0.0), range_m))
            over_ground = far * sweep.cosine[channel]
            points[step - first, channel, 0] = over_ground * ca + x
            points[step - first, channel, 1] = over_ground * sa + y
            points[step - first, channel, 2] = far * sweep.sine[channel] + z
            points[step - first, channel, 3] = F(intensity)


@kernel
def write_tags(sweep: Sweep, pose: LidarPose, tags: UInt8) -> None:
    """Writes what was hit; on the ground and on decks by their rasters.

    Args:
        sweep: Its distances and hits are known.
        pose: Of the LiDAR.
        tags: (K, C) written.
    """
    x, y, z = pose.x, pose.y, pose.z
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
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
def _tag_at(raster: Raster, x: float, y: float) -> np.uint8:
    """The tag of a raster's texel at a place; beyond its edge that of the nearest one."""
    column = int((x - raster.origin[0]) / TEXEL_M)
    row = int((y - raster.origin[1]) / TEXEL_M)
    column = min(max(column, 0), raster.width[0] - 1)
    row = min(max(row, 0), raster.height[0] - 1)
    texel = raster.texels[raster.start[0] + row * raster.width[0] + column]
    return np.uint8((texel >> np.uint32(24)) & np.uint32(_TAG_MASK))


@kernel
def _on_top(boxes: Boxes, box: int, x: float, y: float, z: float) -> bool:
    """Whether a point on a box, in the world frame [m], lies on its upper face."""
    yaw, pitch = np.float64(boxes.yaw[box]), np.float64(boxes.pitch[box])
    dx, dy, dz = x - boxes.centre[box, 0], y - boxes.centre[box, 1], z - boxes.centre[box, 2]
    ahead = math.cos(yaw) * dx + math.sin(yaw) * dy
    up = math.cos(pitch) * dz - math.sin(pitch) * ahead
    return up > boxes.half[box, 2] - 0.02
