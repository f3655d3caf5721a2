"""Which steps and channels of a LiDAR may meet a box, so that only those rays are tested."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel
from di_envs.sensors.scene.boxes import Boxes


class LidarPose(NamedTuple):
    """Where a LiDAR is in the world frame."""

    x: float
    y: float
    z: float
    yaw: float


class Beside(NamedTuple):
    """A LiDAR seen from an upright box: along the box's yaw, from its middle [m]."""

    x: float
    y: float
    z: float
    half_x: float  # half sides of the box, or of an upright one round a tilted box
    half_y: float
    half_z: float


class Window(NamedTuple):
    """The rays of steps [step, end_step) and channels [channel, end_channel).

    Steps count on over the end of a turn: step S + k is step k. A window may be empty.
    """

    step: int
    end_step: int
    channel: int
    end_channel: int


@kernel
def place_beside(boxes: Boxes, box: int, pose: LidarPose) -> Beside:
    """A LiDAR's place beside a box."""
    yaw, pitch = np.float64(boxes.yaw[box]), np.float64(boxes.pitch[box])
    c, s = math.cos(yaw), math.sin(yaw)
    dx, dy = pose.x - boxes.centre[box, 0], pose.y - boxes.centre[box, 1]
    half_x, half_z = np.float64(boxes.half[box, 0]), np.float64(boxes.half[box, 2])
    if pitch != 0.0:
        cp, sp = abs(math.cos(pitch)), abs(math.sin(pitch))
        half_x = boxes.half[box, 0] * cp + boxes.half[box, 2] * sp
        half_z = boxes.half[box, 0] * sp + boxes.half[box, 2] * cp
    return Beside(
        c * dx + s * dy,
        c * dy - s * dx,
        pose.z - boxes.centre[box, 2],
        half_x,
        np.float64(boxes.half[box, 1]),
        half_z,
    )


@kernel
def window_of(
    tangent: Float64, steps: int, range_m: float, beside: Beside, box_yaw: float, yaw: float
) -> Window:
    """The rays that may meet a box.

    Args:
        tangent: (C,) of the channels' elevations, falling.
        steps: Of a turn.
        range_m: How far the LiDAR sees.
        beside: Where it is beside the box.
        box_yaw: The box's, in the world frame [rad].
        yaw: The LiDAR's own [rad].
    """
    nothing = Window(0, 0, 0, 0)
    lx, ly, hx, hy = beside.x, beside.y, beside.half_x, beside.half_y
    near = math.hypot(max(abs(lx) - hx, 0.0), max(abs(ly) - hy, 0.0))
    if near > range_m:
        return nothing
    outside = near > 1e-3
    near = max(near, 1e-3)
    far = math.hypot(abs(lx) + hx, abs(ly) + hy)
    top, bottom = beside.half_z - beside.z, -beside.half_z - beside.z
    highest = top / near if top > 0.0 else top / far
    lowest = bottom / near if bottom < 0.0 else bottom / far
    channel = _first_below(tangent, highest + 1e-6)
    end_channel = _first_below(tangent, lowest - 1e-6)
    if channel >= end_channel:
        return nothing
    if not outside:
        return Window(0, steps, channel, end_channel)
    low, high = _width(lx, ly, hx, hy)
    middle = math.atan2(-ly, -lx) + box_yaw - yaw
    per_step = steps / (2.0 * math.pi)
    first = math.ceil((middle + low) * per_step - 1e-3)
    count = min(math.floor((middle + high) * per_step + 1e-3) + 1 - first, steps)
    return Window(first % steps, first % steps + count, channel, end_channel)


@kernel
def _first_below(tangent: Float64, limit: float) -> int:
    """The first channel whose tangent is at most `limit`, C if none is; they fall."""
    low, high = 0, tangent.shape[0]
    while low < high:
        middle = (low + high) // 2
        if tangent[middle] <= limit:
            high = middle
        else:
            low = middle + 1
    return low


@kernel
def _width(lx: float, ly: float, hx: float, hy: float) -> tuple[float, float]:
    """Least and greatest angle [rad] of a rectangle's corners from the direction of its middle.

    Args:
        lx, ly: Where it is looked from, from its middle and along its sides [m].
        hx, hy: Its half sides [m].
    """
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
