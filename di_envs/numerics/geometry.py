"""Angles, frames and boxes, as scalar kernels.

World frame: x east, y south, z up, yaw clockwise from x towards y. Ego frame: x ahead, y right.
"""

from __future__ import annotations

import math

from di_envs.numerics.kernels import kernel


@kernel
def wrap_angle(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


@kernel
def to_local(
    x: float, y: float, origin_x: float, origin_y: float, origin_yaw: float
) -> tuple[float, float]:
    """A world point in the frame of a pose: (ahead, right) [m]."""
    dx, dy = x - origin_x, y - origin_y
    c, s = math.cos(origin_yaw), math.sin(origin_yaw)
    return c * dx + s * dy, c * dy - s * dx


@kernel
def boxes_overlap(
    ax: float,
    ay: float,
    a_yaw: float,
    a_half_length: float,
    a_half_width: float,
    bx: float,
    by: float,
    b_yaw: float,
    b_half_length: float,
    b_half_width: float,
) -> bool:
    """Whether two oriented rectangles overlap (separating axes); touching does not count.

    Middles and half sides [m], and yaws [rad], are in one frame.
    """
    dx, dy = bx - ax, by - ay
    reach = a_half_length + a_half_width + b_half_length + b_half_width
    if dx * dx + dy * dy > reach * reach:
        return False
    ca, sa, cb, sb = math.cos(a_yaw), math.sin(a_yaw), math.cos(b_yaw), math.sin(b_yaw)
    c, s = abs(ca * cb + sa * sb), abs(sa * cb - ca * sb)
    if abs(dx * ca + dy * sa) >= a_half_length + b_half_length * c + b_half_width * s:
        return False
    if abs(dy * ca - dx * sa) >= a_half_width + b_half_length * s + b_half_width * c:
        return False
    if abs(dx * cb + dy * sb) >= b_half_length + a_half_length * c + a_half_width * s:
        return False
    return abs(dy * cb - dx * sb) < b_half_width + a_half_length * s + a_half_width * c
