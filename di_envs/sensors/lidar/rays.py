"""How far each ray of a LiDAR goes, and what it meets: the ground plane, then box by box.

Each channel meets the plane at a distance known beforehand. Along a step an upright box is a pair
of distances and a pair of heights, which leaves a short loop over channels.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Float32, Float64, Int32, Int64
from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.sensors.lidar.window import Beside, LidarPose, Window, place_beside, window_of
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
    # as in `LidarConfig`; the place is in the ego's frame
    x_m: float
    y_m: float
    z_m: float
    range_m: float
    attenuation_per_m: float
    dropoff: float
    dropoff_intensity: float
    dropoff_zero: float
    noise_m: float
    tangent: Float64  # (C,) of a channel's elevation, falling
    sine: Float32  # (C,)
    cosine: Float32
    over_sine: Float32
    over_cosine: Float32
    turn: Float32  # (S, 2) cosine and sine of a step's azimuth
    scan: Int64  # (2,) first and end step that are scanned
    distance: Float32  # (S, C) written: along the ray
    hit: Int32  # (S, C) written: box, GROUND or NONE


class Between(NamedTuple):
    """Where the rays of one step may be in an upright box: over ground and in height [m]."""

    enter: F  # distance over ground at which they come over or under it
    leave: F
    low: F  # its bottom and top, over the LiDAR
    high: F


class Slabs(NamedTuple):
    """The rays of one step and a tilted box, along the box's own axes.

    A ray of an elevation goes along `cosine flat + sine up`.
    """

    flat_x: F  # direction of the step over ground
    flat_y: F
    flat_z: F
    up_x: F  # what is up; it has no part across
    up_z: F
    from_x: F  # where the rays start, from the box's middle [m]
    from_y: F
    from_z: F
    half_x: F  # half sides of the box [m]
    half_y: F
    half_z: F


@kernel
def meet_ground(sweep: Sweep, above: float) -> None:
    """Sets every ray to the ground plane `above` metres below the LiDAR, or to nothing."""
    first, channels = sweep.scan[0], sweep.distance.shape[1]
    for channel in range(channels):
        sine = np.float64(sweep.sine[channel])
        far = -above / sine if above > 0.0 and sine < -1e-6 else np.inf
        met = far <= sweep.range_m
        sweep.distance[first, channel] = F(far) if met else F(np.inf)
        sweep.hit[first, channel] = GROUND if met else NONE
    for step in range(first + 1, sweep.scan[1]):
        for channel in range(channels):
            sweep.distance[step, channel] = sweep.distance[first, channel]
            sweep.hit[step, channel] = sweep.hit[first, channel]


@kernel
def meet_boxes(sweep: Sweep, pose: LidarPose) -> None:
    """Lowers every ray to the nearest box that it meets from this pose."""
    boxes, steps = sweep.boxes, sweep.turn.shape[0]
    for box in range(boxes.count[0]):
        beside = place_beside(boxes, box, pose)
        box_yaw = np.float64(boxes.yaw[box])
        window = window_of(sweep.tangent, steps, sweep.range_m, beside, box_yaw, pose.yaw)
        if window.step >= window.end_step:
            continue
        if boxes.pitch[box] == 0.0:
            _meet_box(sweep, box, beside, pose.yaw, window)
        else:
            _meet_tilted(sweep, box, beside, pose.yaw, window)


@kernel
def _meet_box(sweep: Sweep, box: int, beside: Beside, yaw: float, window: Window) -> None:
    """Tests an upright box: it is met between two distances over ground and two heights."""
    turn = yaw - np.float64(sweep.boxes.yaw[box])
    c, s = math.cos(turn), math.sin(turn)
    steps, a, b = sweep.turn.shape[0], window.channel, window.end_channel
    left, right = -beside.half_x - beside.x, beside.half_x - beside.x
    back, front = -beside.half_y - beside.y, beside.half_y - beside.y
    low, high = F(-beside.half_z - beside.z), F(beside.half_z - beside.z)
    over_sine, over_cosine = sweep.over_sine[a:b], sweep.over_cosine[a:b]
    for k in range(window.step, window.end_step):
        step = k if k < steps else k - steps
        if step < sweep.scan[0] or step >= sweep.scan[1]:
            continue
        ca, sa = np.float64(sweep.turn[step, 0]), np.float64(sweep.turn[step, 1])
        over_x, over_y = 1.0 / (c * ca - s * sa), 1.0 / (c * sa + s * ca)
        x0, x1, y0, y1 = left * over_x, right * over_x, back * over_y, front * over_y
        enter = max(min(x0, x1), min(y0, y1))
        leave = min(max(x0, x1), max(y0, y1))
        if enter <= leave and leave > 0.0:
            between = Between(F(enter), F(leave), low, high)
            distance, hit = sweep.distance[step, a:b], sweep.hit[step, a:b]
            _meet_upright(distance, hit, over_cosine, over_sine, between, np.int32(box))


@kernel
def _meet_upright(
    distance: Float32,
    hit: Int32,
    over_cosine: Float32,
    over_sine: Float32,
    between: Between,
    box: np.int32,
) -> None:
    """Tests the C rays of one step against an upright box.

    Args:
        distance, hit: (C,) to lower.
        over_cosine, over_sine: (C,) of the elevation, one over them.
        between: Where the box is.
        box: What `hit` becomes.
    """
    for k in range(distance.shape[0]):
        a, b = between.low * over_sine[k], between.high * over_sine[k]
        c, d = between.enter * over_cosine[k], between.leave * over_cosine[k]
        first, last = (a, b) if a < b else (b, a)
        first = c if c > first else first
        last = d if d < last else last
        nearer = (first <= last) & (first > F(NEAR_M)) & (first < distance[k])
        distance[k] = first if nearer else distance[k]
        hit[k] = box if nearer else hit[k]


@kernel
def _meet_tilted(sweep: Sweep, box: int, beside: Beside, yaw: float, window: Window) -> None:
    """Tests a box with a pitch: along its own three axes."""
    boxes = sweep.boxes
    turn, pitch = yaw - np.float64(boxes.yaw[box]), np.float64(boxes.pitch[box])
    c, s, cp, sp = math.cos(turn), math.sin(turn), math.cos(pitch), math.sin(pitch)
    ox, oy, oz = cp * beside.x + sp * beside.z, beside.y, cp * beside.z - sp * beside.x
    hx, hy, hz = boxes.half[box, 0], boxes.half[box, 1], boxes.half[box, 2]
    steps, a, b = sweep.turn.shape[0], window.channel, window.end_channel
    sine, cosine = sweep.sine[a:b], sweep.cosine[a:b]
    for k in range(window.step, window.end_step):
        step = k if k < steps else k - steps
        if step < sweep.scan[0] or step >= sweep.scan[1]:
            continue
        ca, sa = np.float64(sweep.turn[step, 0]), np.float64(sweep.turn[step, 1])
        flat_x, flat_y = c * ca - s * sa, c * sa + s * ca
        slabs = Slabs(
            F(cp * flat_x),
            F(flat_y),
            F(-sp * flat_x),
            F(sp),
            F(cp),
            F(ox),
            F(oy),
            F(oz),
            hx,
            hy,
            hz,
        )
        distance, hit = sweep.distance[step, a:b], sweep.hit[step, a:b]
        _meet_slabs(distance, hit, cosine, sine, slabs, np.int32(box))


@kernel
def _meet_slabs(
    distance: Float32, hit: Int32, cosine: Float32, sine: Float32, slabs: Slabs, box: np.int32
) -> None:
    """Tests the C rays of one step against the three pairs of planes of a box.

    Args:
        distance, hit: (C,) to lower.
        cosine, sine: (C,) of the elevation.
        slabs: The step and the box.
        box: What `hit` becomes.
    """
    one = F(1.0)
    ax, ay, az, ux, uz = slabs.flat_x, slabs.flat_y, slabs.flat_z, slabs.up_x, slabs.up_z
    low_x, high_x = -slabs.half_x - slabs.from_x, slabs.half_x - slabs.from_x
    low_y, high_y = -slabs.half_y - slabs.from_y, slabs.half_y - slabs.from_y
    low_z, high_z = -slabs.half_z - slabs.from_z, slabs.half_z - slabs.from_z
    for k in range(distance.shape[0]):
        over_x = one / (cosine[k] * ax + sine[k] * ux)
        over_y = one / (cosine[k] * ay)
        over_z = one / (cosine[k] * az + sine[k] * uz)
        x0, x1 = low_x * over_x, high_x * over_x
        y0, y1 = low_y * over_y, high_y * over_y
        z0, z1 = low_z * over_z, high_z * over_z
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
