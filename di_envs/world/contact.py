# mypy: disallow_untyped_defs=False
"""What happens when an ego's body meets another: nobody passes through, and no energy is made.

A contact is a perfectly inelastic impact of two point masses along the contact normal; each body
then keeps the part of its velocity that lies along its heading, as neither slides sideways nor
reverses. The ego is pushed out of a vehicle or prop; a walker is pushed out of the ego's way and
lies down (`walk_waiting` is DOWN). Vehicles stay on their lanes and only change speed.
"""

from __future__ import annotations

import math

import numpy as np

from di_envs.kernels import kernel
from di_envs.world.collisions import count_collision, forget_collisions
from di_envs.world.state import ActorKind

SAME_LEVEL_M = 3.0  # bodies further apart in height are on different levels
SLOP_M = 1e-3  # left between bodies that were pushed apart
PASSES = 3  # pushing an ego out of one body may push it into the next
DOWN = 2  # walk_waiting of a walker who was knocked down

ABSENT, WALKER, PROP = int(ActorKind.ABSENT), int(ActorKind.WALKER), int(ActorKind.PROP)

# 1 / mass [1/kg] by ActorKind; a prop does not move
INVERSE_MASS = np.array(
    [0.0, 1 / 1800, 1 / 2500, 1 / 8000, 1 / 12000, 1 / 250, 1 / 100, 1 / 75, 0.0]
)


@kernel
def _axis_depth(offset, cos, sin, a_cos, a_sin, b_cos, b_sin, a_half, a_side, b_half, b_side):
    """How far two boxes overlap along the axis (cos, sin); `offset` is their centres' distance."""
    a_reach = a_half * abs(a_cos * cos + a_sin * sin) + a_side * abs(a_cos * sin - a_sin * cos)
    b_reach = b_half * abs(b_cos * cos + b_sin * sin) + b_side * abs(b_cos * sin - b_sin * cos)
    return a_reach + b_reach - abs(offset)


@kernel
def overlap(state, a, b):
    """How two actors' boxes overlap, seen from above.

    Returns:
        (depth, x, y): the least distance [m] that parts them, 0 where they are apart, and the unit
        vector along which `b` would have to move by it.
    """
    dx, dy = state.x[b] - state.x[a], state.y[b] - state.y[a]
    a_half, a_side = state.half_length[a], state.half_width[a]
    b_half, b_side = state.half_length[b], state.half_width[b]
    reach = a_half + a_side + b_half + b_side
    if dx * dx + dy * dy > reach * reach or abs(state.z[a] - state.z[b]) >= SAME_LEVEL_M:
        return 0.0, 0.0, 0.0
    a_cos, a_sin = math.cos(state.yaw[a]), math.sin(state.yaw[a])
    b_cos, b_sin = math.cos(state.yaw[b]), math.sin(state.yaw[b])
    least, least_x, least_y = math.inf, 0.0, 0.0
    for axis in range(4):
        cos, sin = (a_cos, a_sin) if axis < 2 else (b_cos, b_sin)
        if axis % 2 == 1:
            cos, sin = -sin, cos
        offset = dx * cos + dy * sin
        depth = _axis_depth(
            offset, cos, sin, a_cos, a_sin, b_cos, b_sin, a_half, a_side, b_half, b_side
        )
        if depth <= 0.0:
            return 0.0, 0.0, 0.0
        if depth < least:
            sign = 1.0 if offset >= 0.0 else -1.0
            least, least_x, least_y = depth, sign * cos, sign * sin
    return least, least_x, least_y


@kernel
def _shift(state, actor, dx, dy):
    state.x[actor] += dx
    state.y[actor] += dy


@kernel
def _part(state, ego, other, depth, nx, ny):
    """Moves the bodies apart: the walker if it is one, both egos by half, else the ego."""
    distance = depth + SLOP_M
    if state.kind[other] == WALKER:
        _shift(state, other, distance * nx, distance * ny)
    elif other < state.throttle.shape[0]:
        _shift(state, ego, -0.5 * distance * nx, -0.5 * distance * ny)
        _shift(state, other, 0.5 * distance * nx, 0.5 * distance * ny)
    else:
        _shift(state, ego, -distance * nx, -distance * ny)


@kernel
def _exchange_speed(state, ego, other, nx, ny):
    """Inelastic impact along the normal (from ego to other); speeds never fall below zero."""
    along_ego = math.cos(state.yaw[ego]) * nx + math.sin(state.yaw[ego]) * ny
    along_other = math.cos(state.yaw[other]) * nx + math.sin(state.yaw[other]) * ny
    ego_speed, other_speed = state.speed[ego], state.speed[other]
    closing = ego_speed * along_ego - other_speed * along_other
    if closing <= 0.0:
        return
    ego_weight, other_weight = INVERSE_MASS[state.kind[ego]], INVERSE_MASS[state.kind[other]]
    impulse = closing / (ego_weight + other_weight)
    ego_after = ego_speed - impulse * ego_weight * along_ego
    other_after = other_speed + impulse * other_weight * along_other
    # what would be thrown back stands like a wall instead
    if other_after < 0.0:
        other_after, ego_after = 0.0, ego_speed * (1.0 - along_ego * along_ego)
    if ego_after < 0.0:
        ego_after, other_after = 0.0, other_speed * (1.0 - along_other * along_other)
    state.speed[ego], state.speed[other] = max(ego_after, 0.0), max(other_after, 0.0)


@kernel
def _knock_down(state, ego, walker):
    """The walker takes its share of momentum once, then lies, pushed along without weight."""
    if state.walk_waiting[walker] != DOWN:
        ego_weight = INVERSE_MASS[state.kind[ego]]
        state.speed[ego] *= INVERSE_MASS[WALKER] / (INVERSE_MASS[WALKER] + ego_weight)
    state.speed[walker] = 0.0
    state.walk_waiting[walker] = DOWN
    state.still_ticks[walker] = 0


@kernel
def _meet(state, ego, other, out, n):
    """Resolves one pair; returns (whether they touched, rows in use)."""
    depth, nx, ny = overlap(state, ego, other)
    if depth <= 0.0:
        return False, n
    if state.kind[other] == WALKER:
        _knock_down(state, ego, other)
    else:
        _exchange_speed(state, ego, other, nx, ny)
    _part(state, ego, other, depth, nx, ny)
    n = count_collision(state, ego, other, out, n)
    if other < state.throttle.shape[0]:
        n = count_collision(state, other, ego, out, n)
    return True, n


@kernel
def resolve_contacts(state, out, n):
    """Parts every ego from what its box overlaps, and records the collisions.

    Call it once a tick, after everybody has moved and before `locate_ego`: it moves egos.

    Args:
        state: The world; positions, speeds, walkers and collision memories change.
        out: (N, 8) event rows.
        n: Rows in use.

    Returns:
        The number of rows in use.
    """
    egos = state.throttle.shape[0]
    for ego in range(egos):
        forget_collisions(state, ego)
    for _ in range(PASSES):
        touched = False
        for ego in range(egos):
            if state.kind[ego] == ABSENT:
                continue
            for other in range(ego + 1, state.kind.shape[0]):
                if state.kind[other] == ABSENT:
                    continue
                hit, n = _meet(state, ego, other, out, n)
                touched = touched or hit
        if not touched:
            break
    return n
