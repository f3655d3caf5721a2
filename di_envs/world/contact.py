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
from di_envs.world.bodies import Bodies, box_of, may_touch, overlap
from di_envs.world.collisions import CollisionMemory, count_collision, forget_collisions
from di_envs.world.event_rows import count_rows
from di_envs.world.state import ActorKind

SLOP_M = 1e-3  # left between bodies that were pushed apart
PASSES = 3  # pushing an ego out of one body may push it into the next
DOWN = 2  # walk_waiting of a walker who was knocked down

ABSENT, WALKER = int(ActorKind.ABSENT), int(ActorKind.WALKER)

# 1 / mass [1/kg] by ActorKind; a prop does not move
INVERSE_MASS = np.array(
    [0.0, 1 / 1800, 1 / 2500, 1 / 8000, 1 / 12000, 1 / 250, 1 / 100, 1 / 75, 0.0]
)


@kernel
def speeds_after(ego_speed, ego_weight, ego_along, speed, weight, along):
    """Speeds of an ego and another body after an inelastic impact; neither falls below zero.

    Args:
        ego_speed, speed: Before it [m/s].
        ego_weight, weight: Inverse masses [1/kg], not both 0.
        ego_along, along: Cosines between each heading and the normal from the ego to the other.
    """
    closing = ego_speed * ego_along - speed * along
    if closing <= 0.0:
        return ego_speed, speed
    impulse = closing / (ego_weight + weight)
    ego_after = ego_speed - impulse * ego_weight * ego_along
    after = speed + impulse * weight * along
    # what would be thrown back stands like a wall instead
    if after < 0.0:
        after, ego_after = 0.0, ego_speed * (1.0 - ego_along * ego_along)
    if ego_after < 0.0:
        ego_after, after = 0.0, speed * (1.0 - along * along)
    return max(ego_after, 0.0), max(after, 0.0)


@kernel
def _exchange_speed(bodies, ego, other, nx, ny):
    ego_along = math.cos(bodies.yaw[ego]) * nx + math.sin(bodies.yaw[ego]) * ny
    along = math.cos(bodies.yaw[other]) * nx + math.sin(bodies.yaw[other]) * ny
    bodies.speed[ego], bodies.speed[other] = speeds_after(
        bodies.speed[ego],
        INVERSE_MASS[bodies.kind[ego]],
        ego_along,
        bodies.speed[other],
        INVERSE_MASS[bodies.kind[other]],
        along,
    )


@kernel
def _part(bodies, ego, other, share, dx, dy):
    """Moves the bodies apart: the ego by `share` of the way, the other by the rest."""
    bodies.x[ego] -= share * dx
    bodies.y[ego] -= share * dy
    bodies.x[other] += (1.0 - share) * dx
    bodies.y[other] += (1.0 - share) * dy


@kernel
def _knock_down(bodies, walk_waiting, lying_ticks, ego, walker):
    """The walker takes its share of momentum once, then lies, pushed along without weight."""
    if walk_waiting[walker] != DOWN:
        ego_weight = INVERSE_MASS[bodies.kind[ego]]
        bodies.speed[ego] *= INVERSE_MASS[WALKER] / (INVERSE_MASS[WALKER] + ego_weight)
    bodies.speed[walker] = 0.0
    walk_waiting[walker] = DOWN
    lying_ticks[walker] = 0


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
    bodies = Bodies(
        state.kind,
        state.x,
        state.y,
        state.z,
        state.yaw,
        state.speed,
        state.half_length,
        state.half_width,
    )
    memory = CollisionMemory(
        state.last_collision_actor,
        state.last_collision_tick,
        state.collision_places,
        state.finished,
    )
    tick = state.tick[()]
    before = n
    for ego in range(memory.finished.size):
        forget_collisions(memory, ego, tick, bodies.x[ego], bodies.y[ego])
    for _ in range(PASSES):
        touched, n = _resolve_once(
            bodies, memory, state.walk_waiting, state.still_ticks, tick, out, n
        )
        if not touched:
            break
    count_rows(state.counts, out, before, n)
    return n


@kernel
def _resolve_once(bodies, memory, walk_waiting, lying_ticks, tick, out, n):
    """Resolves each overlap of an ego once; returns (whether there was one, rows in use)."""
    touched = False
    egos = memory.finished.size
    for ego in range(egos):
        for other in range(ego + 1, bodies.kind.size):
            if not may_touch(bodies, ego, other):
                continue
            if bodies.kind[other] == ABSENT or bodies.kind[ego] == ABSENT:
                continue
            depth, nx, ny = overlap(box_of(bodies, ego), box_of(bodies, other))
            if depth <= 0.0:
                continue
            touched = True
            share = 0.5 if other < egos else 1.0
            if bodies.kind[other] == WALKER:
                _knock_down(bodies, walk_waiting, lying_ticks, ego, other)
                share = 0.0
            else:
                _exchange_speed(bodies, ego, other, nx, ny)
            _part(bodies, ego, other, share, (depth + SLOP_M) * nx, (depth + SLOP_M) * ny)
            n = count_collision(memory, bodies, ego, other, tick, out, n)
            if other < egos:
                n = count_collision(memory, bodies, other, ego, tick, out, n)
    return touched, n
