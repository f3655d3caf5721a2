"""Boxes of actors: how they overlap, and what the event rules read of an ego."""

from __future__ import annotations

import math
from typing import NamedTuple

from di_envs.numerics.kernels import kernel
from di_envs.world.state import State

LARGEST_M = 60.0  # no two bodies touch whose middles are further apart
SAME_LEVEL_M = 3.0  # bodies further apart in height are on different levels


class Box(NamedTuple):
    """One body: its pose and size."""

    x: float
    y: float
    z: float
    yaw: float
    half_length: float
    half_width: float


class EgoNow(NamedTuple):
    """What the event rules read of an ego in a tick."""

    ego: int  # its actor index
    tick: int
    x: float
    y: float
    z: float
    yaw: float
    speed: float
    half_length: float
    lane: int  # nearest driving lane, -1 for none
    lane_m: float


@kernel
def box_of(state: State, actor: int) -> Box:
    """The box of one actor."""
    return Box(
        state.x[actor],
        state.y[actor],
        state.z[actor],
        state.yaw[actor],
        state.half_length[actor],
        state.half_width[actor],
    )


@kernel
def may_touch(state: State, a: int, b: int) -> bool:
    """Whether two actors are so near each other that their boxes might overlap."""
    dx, dy = state.x[b] - state.x[a], state.y[b] - state.y[a]
    if abs(dx) > LARGEST_M or abs(dy) > LARGEST_M:
        return False
    reach = state.half_length[a] + state.half_width[a]
    reach += state.half_length[b] + state.half_width[b]
    return dx * dx + dy * dy <= reach * reach and abs(state.z[b] - state.z[a]) < SAME_LEVEL_M


@kernel
def overlap(a: Box, b: Box) -> tuple[float, float, float]:
    """How two boxes overlap, seen from above, by separating axes.

    Returns:
        (depth, x, y): the least distance [m] that parts them, 0 where they are apart, and the unit
        vector along which `b` would have to move by it.
    """
    dx, dy = b.x - a.x, b.y - a.y
    a_cos, a_sin, b_cos, b_sin = math.cos(a.yaw), math.sin(a.yaw), math.cos(b.yaw), math.sin(b.yaw)
    c, s = abs(a_cos * b_cos + a_sin * b_sin), abs(a_sin * b_cos - a_cos * b_sin)
    least, least_x, least_y = math.inf, 0.0, 0.0
    for axis in range(4):
        if axis < 2:
            cos, sin, own, turned, other = a_cos, a_sin, a, b, axis
        else:
            cos, sin, own, turned, other = b_cos, b_sin, b, a, axis - 2
        reach = own.half_length + turned.half_length * c + turned.half_width * s
        if other == 1:
            cos, sin = -sin, cos
            reach = own.half_width + turned.half_length * s + turned.half_width * c
        offset = dx * cos + dy * sin
        depth = reach - abs(offset)
        if depth <= 0.0:
            return 0.0, 0.0, 0.0
        if depth < least:
            sign = 1.0 if offset >= 0.0 else -1.0
            least, least_x, least_y = depth, sign * cos, sign * sin
    return least, least_x, least_y
