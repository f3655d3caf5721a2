"""How far each ray of a LiDAR goes, and what it meets: the ground plane, then box by box.

Each channel meets the plane at a distance known beforehand. Along a step an upright box is a pair
of distances and a pair of heights, which leaves a short loop over channels.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.sensors.lidar.window import place_beside, window_of
from di_envs.sensors.scene.boxes import Boxes
from di_envs.sensors.scene.scene import Scene
from di_envs.world.state import State

NEAR_M = 0.05  # nothing nearer is hit
NONE, GROUND = -2, -1  # what a ray hit, where it is no box
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
    scan: NDArray[np.int64]  # (2,) first and end step that are scanned
    distance: NDArray[np.float32]  # (S, C) written: along the ray
    hit: NDArray[np.int32]  # (S, C) written: box, GROUND or NONE


@kernel
def meet_ground(sweep, above):
    """Sets every ray to the ground plane `above` metres below the LiDAR, or to nothing."""
    first, channels = sweep.scan[0], sweep.distance.shape[1]
    for channel in range(channels):
        sine = np.float64(sweep.sine[channel])
        far = -above / sine if above > 0.0 and sine < -1e-6 else np.inf
        met = far <= sweep.numbers[3]
        sweep.distance[first, channel] = F(far) if met else F(np.inf)
        sweep.hit[first, channel] = GROUND if met else NONE
    for step in range(first + 1, sweep.scan[1]):
        for channel in range(channels):
            sweep.distance[step, channel] = sweep.distance[first, channel]
            sweep.hit[step, channel] = sweep.hit[first, channel]


@kernel
def meet_boxes(sweep, x, y, z, yaw):
    """Lowers every ray to the nearest box that it meets from this pose."""
    window = np.zeros(4, np.int64)
    local = np.zeros(6)
    for box in range(sweep.boxes.count[0]):
        place_beside(sweep.boxes, box, x, y, z, local)
        if window_of(sweep, box, local, yaw, window):
            if sweep.boxes.pitch[box] == 0.0:
                _meet_box(sweep, box, local, yaw, window)
            else:
                _meet_tilted(sweep, box, local, yaw, window)


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
        if step < sweep.scan[0] or step >= sweep.scan[1]:
            continue
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
        if step < sweep.scan[0] or step >= sweep.scan[1]:
            continue
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
