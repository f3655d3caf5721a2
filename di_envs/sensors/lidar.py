# mypy: disallow_untyped_defs=False
"""LiDAR: a sweep of rays against the same scene that cameras show.

Each channel meets the ground plane at a distance known beforehand. For each box the steps and
channels that may meet it are worked out, and only those rays are tested; along a step a box is a
pair of distances, which leaves a short loop over channels. `docs/conventions.md` has the frames.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.bundles import by_reference
from di_envs.kernels import bind, kernel
from di_envs.keyed_random import Stream, keyed_part, mix, normal
from di_envs.sensors.boxes import Boxes, Material
from di_envs.sensors.lidar_config import LidarConfig
from di_envs.sensors.scene import Scene, box_buffer, collect_boxes, scene_of
from di_envs.sensors.surfaces import TEXEL_M
from di_envs.sensors.tags import TAG_BITS, Tag
from di_envs.town.town import Town
from di_envs.world.state import State
from di_envs.world.world import WorldView

NEAR_M = 0.05  # nothing nearer is hit
_NONE, _GROUND = -2, -1  # what a ray hit, where it is no box
_KEYS = 1 << 27  # draws kept apart for each ego, more than a LiDAR can have rays
_DECK, _NO_TAG = int(Material.DECK), int(Tag.NONE)
_TAG_MASK = (1 << TAG_BITS) - 1
_LIDAR, _NOISE = int(Stream.LIDAR), int(Stream.LIDAR_NOISE)
F = np.float32


@by_reference
class Sweep(NamedTuple):
    """Everything that one sweep reads and writes: one argument, as each costs time."""

    state: State
    scene: Scene
    boxes: Boxes
    numbers: NDArray[np.float64]  # (9,) x, y, z, range, attenuation, three drop-offs, noise
    tangent: NDArray[np.float64]  # (C,) of a channel's elevation, falling
    sine: NDArray[np.float32]  # (C,)
    cosine: NDArray[np.float32]
    over_sine: NDArray[np.float32]
    over_cosine: NDArray[np.float32]
    turn: NDArray[np.float32]  # (S, 2) cosine and sine of a step's azimuth
    distance: NDArray[np.float32]  # (S, C) written: along the ray
    hit: NDArray[np.int32]  # (S, C) written: box, _GROUND or _NONE


@kernel
def sweep_rays(sweep, ego, points, tags):
    """Takes a sweep.

    Args:
        sweep: `Sweep`; its boxes were collected before.
        ego: The ego's index.
        points: (S, C, 4) written: x, y, z [m] in the ego's frame and intensity, or zeros.
        tags: (S, C) written: `Tag`; or (0, C) where it is not asked for.
    """
    state, numbers = sweep.state, sweep.numbers
    yaw = state.yaw[ego]
    c, s = math.cos(yaw), math.sin(yaw)
    x = state.x[ego] + c * numbers[0] - s * numbers[1]
    y = state.y[ego] + s * numbers[0] + c * numbers[1]
    z = state.z[ego] + numbers[2]
    _meet_ground(sweep, z - sweep.scene.base_z[0])
    window = np.zeros(4, np.int64)
    local = np.zeros(6)
    for box in range(sweep.boxes.count[0]):
        _place(sweep.boxes, box, x, y, z, local)
        if _window(sweep, box, local, yaw, window):
            if sweep.boxes.pitch[box] == 0.0:
                _meet_box(sweep, box, local, yaw, window)
            else:
                _meet_tilted(sweep, box, local, yaw, window)
    _write_points(sweep, ego, points)
    if tags.shape[0] > 0:
        _write_tags(sweep, x, y, z, c, s, points, tags)


@kernel
def _meet_ground(sweep, above):
    """Sets every ray to the ground plane `above` metres below the LiDAR, or to nothing."""
    steps, channels = sweep.distance.shape
    for channel in range(channels):
        sine = np.float64(sweep.sine[channel])
        far = -above / sine if above > 0.0 and sine < -1e-6 else np.inf
        met = far <= sweep.numbers[3]
        sweep.distance[0, channel] = F(far) if met else F(np.inf)
        sweep.hit[0, channel] = _GROUND if met else _NONE
    for step in range(1, steps):
        for channel in range(channels):
            sweep.distance[step, channel] = sweep.distance[0, channel]
            sweep.hit[step, channel] = sweep.hit[0, channel]


@kernel
def _place(boxes, box, x, y, z, local):
    """Writes the LiDAR's place beside a box's yaw, and half sides of an upright box round it."""
    yaw, pitch = np.float64(boxes.yaw[box]), np.float64(boxes.pitch[box])
    c, s = math.cos(yaw), math.sin(yaw)
    dx, dy = x - boxes.centre[box, 0], y - boxes.centre[box, 1]
    local[0], local[1], local[2] = c * dx + s * dy, c * dy - s * dx, z - boxes.centre[box, 2]
    for k in range(3):
        local[3 + k] = boxes.half[box, k]
    if pitch != 0.0:
        cp, sp = abs(math.cos(pitch)), abs(math.sin(pitch))
        local[3] = boxes.half[box, 0] * cp + boxes.half[box, 2] * sp
        local[5] = boxes.half[box, 0] * sp + boxes.half[box, 2] * cp


@kernel
def _window(sweep, box, local, yaw, window):
    """Writes the first and end step, and first and end channel, that may meet a box.

    Returns:
        Whether there are any.
    """
    lx, ly, hx, hy = local[0], local[1], local[3], local[4]
    near = math.hypot(max(abs(lx) - hx, 0.0), max(abs(ly) - hy, 0.0))
    if near > sweep.numbers[3]:
        return False
    beside = near > 1e-3
    near = max(near, 1e-3)
    far = math.hypot(abs(lx) + hx, abs(ly) + hy)
    top, bottom = local[5] - local[2], -local[5] - local[2]
    highest = top / near if top > 0.0 else top / far
    lowest = bottom / near if bottom < 0.0 else bottom / far
    channels, steps = sweep.tangent.shape[0], sweep.turn.shape[0]
    window[2] = _first_below(sweep.tangent, highest + 1e-6)
    window[3] = _first_below(sweep.tangent, lowest - 1e-6)
    if window[2] >= min(window[3], channels):
        return False
    window[0], window[1] = 0, steps
    if not beside:
        return True
    low, high = _width(lx, ly, hx, hy)
    middle = math.atan2(-ly, -lx) + np.float64(sweep.boxes.yaw[box]) - yaw
    per_step = steps / (2.0 * math.pi)
    first = math.ceil((middle + low) * per_step - 1e-3)
    count = min(math.floor((middle + high) * per_step + 1e-3) + 1 - first, steps)
    window[0] = first % steps
    window[1] = window[0] + count
    return count > 0


@kernel
def _first_below(tangent, limit):
    """The first channel whose tangent is at most `limit`; they fall."""
    low, high = 0, tangent.shape[0]
    while low < high:
        middle = (low + high) // 2
        if tangent[middle] <= limit:
            high = middle
        else:
            low = middle + 1
    return low


@kernel
def _width(lx, ly, hx, hy):
    """Least and greatest angle of a rectangle's corners from the direction of its middle."""
    far = math.hypot(lx, ly)
    ux, uy = -lx / far, -ly / far
    low, high, ahead = 0.0, 0.0, True
    for corner in range(4):
        px = (hx if corner & 1 else -hx) - lx
        py = (hy if corner & 2 else -hy) - ly
        along, across = ux * px + uy * py, ux * py - uy * px
        ahead = ahead and along > 1e-3 * far
        if ahead:
            low, high = min(low, across / along), max(high, across / along)
    if ahead:
        return math.atan(low), math.atan(high)
    low, high = 0.0, 0.0
    for corner in range(4):
        px = (hx if corner & 1 else -hx) - lx
        py = (hy if corner & 2 else -hy) - ly
        angle = math.atan2(ux * py - uy * px, ux * px + uy * py)
        low, high = min(low, angle), max(high, angle)
    return low, high


@kernel
def _meet_box(sweep, box, local, yaw, window):
    """Tests an upright box: it is met between two distances over ground and two heights."""
    turn = yaw - np.float64(sweep.boxes.yaw[box])
    c, s = math.cos(turn), math.sin(turn)
    steps, a, b = sweep.turn.shape[0], window[2], window[3]
    left, right = -local[3] - local[0], local[3] - local[0]
    back, front = -local[4] - local[1], local[4] - local[1]
    low, high = F(-local[5] - local[2]), F(local[5] - local[2])
    over_sine, over_cosine = sweep.over_sine[a:b], sweep.over_cosine[a:b]
    for k in range(window[0], window[1]):
        step = k if k < steps else k - steps
        ca, sa = np.float64(sweep.turn[step, 0]), np.float64(sweep.turn[step, 1])
        over_x, over_y = 1.0 / (c * ca - s * sa), 1.0 / (c * sa + s * ca)
        x0, x1, y0, y1 = left * over_x, right * over_x, back * over_y, front * over_y
        enter = max(min(x0, x1), min(y0, y1))
        leave = min(max(x0, x1), max(y0, y1))
        if enter <= leave and leave > 0.0:
            _meet_upright(
                sweep.distance[step, a:b], sweep.hit[step, a:b], over_cosine, over_sine,
                F(enter), F(leave), low, high, np.int32(box),
            )  # fmt: skip


@kernel
def _meet_upright(distance, hit, over_cosine, over_sine, enter, leave, low, high, box):
    """Tests the rays of one step, between distances over ground and heights over the LiDAR."""
    for k in range(distance.shape[0]):
        a, b = low * over_sine[k], high * over_sine[k]
        c, d = enter * over_cosine[k], leave * over_cosine[k]
        first, last = (a, b) if a < b else (b, a)
        first = c if c > first else first
        last = d if d < last else last
        nearer = (first <= last) & (first > F(NEAR_M)) & (first < distance[k])
        distance[k] = first if nearer else distance[k]
        hit[k] = box if nearer else hit[k]


@kernel
def _meet_tilted(sweep, box, local, yaw, window):
    """Tests a box with a pitch: along its own three axes."""
    boxes = sweep.boxes
    turn, pitch = yaw - np.float64(boxes.yaw[box]), np.float64(boxes.pitch[box])
    c, s, cp, sp = math.cos(turn), math.sin(turn), math.cos(pitch), math.sin(pitch)
    ox, oy, oz = cp * local[0] + sp * local[2], local[1], cp * local[2] - sp * local[0]
    hx, hy, hz = boxes.half[box, 0], boxes.half[box, 1], boxes.half[box, 2]
    steps, a, b = sweep.turn.shape[0], window[2], window[3]
    sine, cosine = sweep.sine[a:b], sweep.cosine[a:b]
    for k in range(window[0], window[1]):
        step = k if k < steps else k - steps
        ca, sa = np.float64(sweep.turn[step, 0]), np.float64(sweep.turn[step, 1])
        flat_x, flat_y = c * ca - s * sa, c * sa + s * ca
        _meet_slabs(
            sweep.distance[step, a:b], sweep.hit[step, a:b], cosine, sine,
            F(cp * flat_x), F(flat_y), F(-sp * flat_x), F(sp), F(cp),
            F(ox), F(oy), F(oz), hx, hy, hz, np.int32(box),
        )  # fmt: skip


@kernel
def _meet_slabs(distance, hit, cosine, sine, ax, ay, az, ux, uz, ox, oy, oz, hx, hy, hz, box):
    """Tests the rays of one step against three pairs of planes.

    Args:
        distance, hit: (C,) to lower.
        cosine, sine: (C,) of the elevation.
        ax, ay, az: Direction over ground along the box's axes.
        ux, uz: What is up, along them.
        ox, oy, oz: Where the rays start.
        hx, hy, hz: Half sides.
        box: What `hit` becomes.
    """
    one = F(1.0)
    for k in range(distance.shape[0]):
        over_x = one / (cosine[k] * ax + sine[k] * ux)
        over_y = one / (cosine[k] * ay)
        over_z = one / (cosine[k] * az + sine[k] * uz)
        x0, x1 = (-hx - ox) * over_x, (hx - ox) * over_x
        y0, y1 = (-hy - oy) * over_y, (hy - oy) * over_y
        z0, z1 = (-hz - oz) * over_z, (hz - oz) * over_z
        x0, x1 = (x0, x1) if x0 < x1 else (x1, x0)
        y0, y1 = (y0, y1) if y0 < y1 else (y1, y0)
        z0, z1 = (z0, z1) if z0 < z1 else (z1, z0)
        first = x0 if x0 > y0 else y0
        first = z0 if z0 > first else first
        last = x1 if x1 < y1 else y1
        last = z1 if z1 < last else last
        nearer = (first <= last) & (first > F(NEAR_M)) & (first < distance[k])
        distance[k] = first if nearer else distance[k]
        hit[k] = box if nearer else hit[k]


@kernel
def _write_points(sweep, ego, points):
    """Writes points and intensities; drops rays and adds noise by keyed draws."""
    state, numbers = sweep.state, sweep.numbers
    steps, channels = sweep.distance.shape
    seed, tick, key = state.seed[()], state.tick[()], np.uint64(ego) * np.uint64(_KEYS)
    part = keyed_part(seed, _LIDAR, tick)
    drops = numbers[5] > 0.0 or numbers[7] > 0.0
    least, slope = 1.0 - numbers[7], numbers[7] / max(numbers[6], 1e-9)
    x, y, z = F(numbers[0]), F(numbers[1]), F(numbers[2])
    for step in range(steps):
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
                sweep.hit[step, channel] = _NONE
                for k in range(4):
                    points[step, channel, k] = F(0.0)
                continue
            if numbers[8] > 0.0:
                noisy = np.float64(far) + numbers[8] * normal(seed, _NOISE, tick, ray)
                far = F(min(max(noisy, 0.0), numbers[3]))
            over_ground = far * sweep.cosine[channel]
            points[step, channel, 0] = over_ground * ca + x
            points[step, channel, 1] = over_ground * sa + y
            points[step, channel, 2] = far * sweep.sine[channel] + z
            points[step, channel, 3] = F(intensity)


@kernel
def _write_tags(sweep, x, y, z, c, s, points, tags):
    """Writes what was hit; on the ground and on decks by their rasters."""
    scene, boxes = sweep.scene, sweep.boxes
    steps, channels = sweep.distance.shape
    for step in range(steps):
        ca, sa = np.float64(sweep.turn[step, 0]), np.float64(sweep.turn[step, 1])
        wx, wy = c * ca - s * sa, s * ca + c * sa
        for channel in range(channels):
            hit = sweep.hit[step, channel]
            if hit == _NONE:
                tags[step, channel] = _NO_TAG
                continue
            far = np.float64(sweep.distance[step, channel])
            flat = far * np.float64(sweep.cosine[channel])
            px, py = x + flat * wx, y + flat * wy
            if hit == _GROUND:
                tags[step, channel] = _tag_at(scene.ground, px, py)
                continue
            tags[step, channel] = boxes.tag[hit]
            if boxes.material[hit] == _DECK:
                pz = z + far * np.float64(sweep.sine[channel])
                if _on_top(boxes, hit, px, py, pz):
                    tags[step, channel] = _tag_at(scene.deck, px, py)


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


class Lidar:
    """A LiDAR on an ego. Keeps no memory: only buffers and static tables."""

    def __init__(self, town: Town, config: LidarConfig, ego: int = 0) -> None:
        """Builds the town's scene, unless that was done before.

        Args:
            town: The town.
            config: Its rays and mounting.
            ego: Index of the ego that carries it.
        """
        self.config = config
        self._ego = ego
        self._scene = scene_of(town)
        self._range_m = config.reach_m

    def start(self, view: WorldView) -> None:
        """Takes up an episode: the view's state arrays."""
        self._sweep = _sweep(self.config, view.state, self._scene)
        boxes = self._sweep.boxes
        self._collect = bind(
            collect_boxes, self._scene, view.state, self._ego, self._range_m, boxes
        )
        self._rays = bind(sweep_rays, self._sweep, self._ego, *self._images())

    def observe(self) -> dict[str, NDArray[Any]]:
        """The present sweep, `lidar` and what else was asked for; every array is a fresh one."""
        sweep, config = self._sweep, self.config
        self._collect(self._scene, sweep.state, self._ego, self._range_m, sweep.boxes)
        points, tags = self._images()
        self._rays(sweep, self._ego, points, tags)
        found: dict[str, NDArray[Any]] = {"lidar": points.reshape(config.rays, 4)}
        if config.semantic:
            found["lidar_semantic"] = tags.reshape(config.rays)
        return found

    def _images(self) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        steps, channels = self.config.steps, self.config.channels
        tags = np.zeros((steps if self.config.semantic else 0, channels), np.uint8)
        return np.zeros((steps, channels, 4), np.float32), tags


def _sweep(config: LidarConfig, state: State, scene: Scene) -> Sweep:
    numbers = (
        config.x_m, config.y_m, config.z_m, config.range_m, config.attenuation_per_m,
        config.dropoff, config.dropoff_intensity, config.dropoff_zero, config.noise_m,
    )  # fmt: skip
    elevation = np.radians(np.linspace(config.upper_deg, config.lower_deg, config.channels))
    elevation = np.where(np.abs(elevation) < 1e-7, -1e-7, elevation)  # level, but no 0 / 0
    azimuth = 2.0 * np.pi * np.arange(config.steps) / config.steps
    size = (config.steps, config.channels)
    return Sweep(
        state=state,
        scene=scene,
        boxes=box_buffer(),
        numbers=np.array(numbers, np.float64),
        tangent=np.tan(elevation),
        sine=np.sin(elevation).astype(np.float32),
        cosine=np.cos(elevation).astype(np.float32),
        over_sine=(1.0 / np.sin(elevation)).astype(np.float32),
        over_cosine=(1.0 / np.cos(elevation)).astype(np.float32),
        turn=np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1).astype(np.float32),
        distance=np.zeros(size, np.float32),
        hit=np.zeros(size, np.int32),
    )
