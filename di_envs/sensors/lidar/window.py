"""Which steps and channels of a LiDAR may meet a box, so that only those rays are tested."""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.kernels import kernel


@kernel
def place_beside(boxes, box, x, y, z, local):
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
def window_of(sweep, box, local, yaw, window):
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
