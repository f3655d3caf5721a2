"""What happens when an ego's body meets another: nobody passes through, and no energy is made.

A contact is a perfectly inelastic impact of two point masses along the contact normal; each body
then keeps the part of its velocity that lies along its heading, as neither slides sideways nor
reverses. Vehicles stay on their lanes and only change speed: who was hit stands on the brakes, and
a vehicle that stands is not moved by a push that its locked wheels hold. The ego is pushed out of a
vehicle or prop. Who is on foot or on two wheels falls (`walk_waiting` is DOWN), is thrown along the
normal, slides and lies, and is then in nobody's way. What becomes of them later is in `struck.py`.
"""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel
from di_envs.world.bodies import box_of, may_touch, overlap
from di_envs.world.events.collisions import count_contact, forget_collisions, is_impact
from di_envs.world.events.rows import count_rows
from di_envs.world.state import TICK_S, ActorKind, State
from di_envs.world.struck import DOWN, GRIP_MPS2, falls, strike

SLOP_M = 1e-3  # left between bodies that were pushed apart
PASSES = 3  # pushing an ego out of one body may push it into the next
HELD_MPS = GRIP_MPS2 * TICK_S  # that locked wheels take of a speed in a tick

ABSENT, DEBRIS = int(ActorKind.ABSENT), int(ActorKind.DEBRIS)

# 1 / mass [1/kg] by ActorKind; what is lifeless does not move
INVERSE_MASS = np.array(
    [0.0, 1 / 1800, 1 / 2500, 1 / 8000, 1 / 12000, 1 / 250, 1 / 100, 1 / 75, 0.0, 0.0, 0.0]
)


@kernel
def speeds_after(
    ego_speed: float,
    ego_weight: float,
    ego_along: float,
    speed: float,
    weight: float,
    along: float,
    held: float,
) -> tuple[float, float]:
    """Speeds of an ego and another body after an inelastic impact; neither falls below zero.

    Args:
        ego_speed, speed: Before it [m/s].
        ego_weight, weight: Inverse masses [1/kg], not both 0.
        ego_along, along: Cosines between each heading and the normal from the ego to the other.
        held: Speed [m/s] that the other would have to gain before it moves at all, as it stands.
    """
    closing = ego_speed * ego_along - speed * along
    if closing <= 0.0:
        return ego_speed, speed
    impulse = closing / (ego_weight + weight)
    ego_after = ego_speed - impulse * ego_weight * ego_along
    after = speed + impulse * weight * along
    # what would be thrown back, or is held, stands like a wall instead
    if after < 0.0 or (speed <= 0.0 and impulse * weight <= held):
        after, ego_after = 0.0, ego_speed * (1.0 - ego_along * ego_along)
    if ego_after < 0.0:
        ego_after, after = 0.0, speed * (1.0 - along * along)
    return max(ego_after, 0.0), max(after, 0.0)


@kernel
def _exchange_speed(state: State, ego: int, other: int, nx: float, ny: float) -> None:
    """Gives two bodies their speeds after an impact along the unit normal (nx, ny), world frame."""
    ego_along = math.cos(state.yaw[ego]) * nx + math.sin(state.yaw[ego]) * ny
    along = math.cos(state.yaw[other]) * nx + math.sin(state.yaw[other]) * ny
    state.speed[ego], state.speed[other] = speeds_after(
        state.speed[ego],
        INVERSE_MASS[state.kind[ego]],
        ego_along,
        state.speed[other],
        INVERSE_MASS[state.kind[other]],
        along,
        HELD_MPS if other >= state.throttle.size else 0.0,
    )


@kernel
def _part(state: State, ego: int, other: int, share: float, dx: float, dy: float) -> None:
    """Moves the bodies apart: the ego by `share` of the way, the other by the rest."""
    state.x[ego] -= share * dx
    state.y[ego] -= share * dy
    state.x[other] += (1.0 - share) * dx
    state.y[other] += (1.0 - share) * dy


@kernel
def _throw(state: State, ego: int, other: int, nx: float, ny: float) -> None:
    """Who stood in the ego's way takes on its speed along the unit normal (nx, ny), world frame."""
    weight, ego_weight = INVERSE_MASS[state.kind[other]], INVERSE_MASS[state.kind[ego]]
    along = math.cos(state.yaw[ego]) * nx + math.sin(state.yaw[ego]) * ny
    impulse = max(state.speed[ego] * along, 0.0) / (ego_weight + weight)
    state.speed[ego] = max(state.speed[ego] - impulse * ego_weight * along, 0.0)
    state.speed[other] = impulse * weight
    state.yaw[other] = math.atan2(ny, nx)


@kernel
def _collide(state: State, ego: int, other: int, nx: float, ny: float) -> None:
    """Gives an ego and another body their speeds after a contact."""
    if falls(state.kind[other]) and state.lane[other] < 0:
        _throw(state, ego, other, nx, ny)
    else:
        _exchange_speed(state, ego, other, nx, ny)


@kernel
def resolve_contacts(state: State, out: Float64, n: int) -> int:
    """Parts every ego from what its box overlaps, and records the collisions.

    Call it once a tick, after everybody has moved and before `locate_ego`: it moves egos.

    Args:
        state: The world; positions, speeds, walkers and collision memories change.
        out: (N, 8) event rows.
        n: Rows in use.

    Returns:
        The number of rows in use.
    """
    before = n
    for ego in range(state.throttle.size):
        forget_collisions(state, ego)
    for _ in range(PASSES):
        touched, n = _resolve_once(state, out, n)
        if not touched:
            break
    count_rows(state.counts, out, before, n)
    return n


@kernel
def _resolve_once(state: State, out: Float64, n: int) -> tuple[bool, int]:
    """Resolves each overlap of an ego once; returns (whether there was one, rows in use)."""
    touched = False
    egos = state.throttle.size
    for ego in range(egos):
        for other in range(ego + 1, state.kind.size):
            if not may_touch(state, ego, other):
                continue
            if state.kind[other] == ABSENT or state.kind[ego] == ABSENT:
                continue
            # wheels go over what lies flat, and round or over who lies there
            if state.kind[other] == DEBRIS or state.walk_waiting[other] == DOWN:
                continue
            depth, nx, ny = overlap(box_of(state, ego), box_of(state, other))
            if depth <= 0.0:
                continue
            touched = True
            _collide(state, ego, other, nx, ny)
            share = 0.5 if other < egos else 1.0
            if falls(state.kind[other]):
                share = 0.0
            _part(state, ego, other, share, (depth + SLOP_M) * nx, (depth + SLOP_M) * ny)
            if other >= egos and is_impact(state, ego, other):
                strike(state, other)
            n = count_contact(state, ego, other, out, n)
            if other < egos:
                n = count_contact(state, other, ego, out, n)
    return touched, n
