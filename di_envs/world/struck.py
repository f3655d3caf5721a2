"""What becomes of who was hit: walkers and cyclists fall and lie, drivers brake and stand a while.

Nothing keeps rolling before an ego for long: sliding and locked wheels take its speed away.
"""

from __future__ import annotations

import math

from di_envs.numerics.kernels import kernel
from di_envs.world.state import TICK_S, ActorKind, State

DOWN = 2  # walk_waiting of who was knocked down
SLIDE_MPS2 = 6.0  # that a body on the ground loses
GRIP_MPS2 = 8.0  # that locked wheels take, more than an ego can push with
LIE_TICKS = round(10.0 / TICK_S)  # until who lies is taken away
SHOCK_TICKS = round(5.0 / TICK_S)  # that a driver stands who was hit

ABSENT = int(ActorKind.ABSENT)
FIRST_OF_TWO_WHEELS, LAST_WHO_FALLS = int(ActorKind.MOTORCYCLE), int(ActorKind.WALKER)


@kernel
def falls(kind: int) -> bool:
    """Whether an actor of this kind falls when it is hit: two wheels, and people on foot."""
    return FIRST_OF_TWO_WHEELS <= kind <= LAST_WHO_FALLS


@kernel
def footprint(state: State, actor: int) -> tuple[float, float]:
    """Half length and half width of an actor from above [m].

    Who was knocked down lies: people along their heading, two wheels on their right side.
    """
    length, width = state.half_length[actor], state.half_width[actor]
    if state.walk_waiting[actor] != DOWN:
        return length, width
    if state.kind[actor] == LAST_WHO_FALLS:
        return 0.5 * state.height[actor], width
    return length, 0.5 * state.height[actor]


@kernel
def strike(state: State, actor: int) -> None:
    """Notes that an actor was hit, which begins what becomes of it."""
    if falls(state.kind[actor]):
        state.walk_waiting[actor] = DOWN
        state.still_ticks[actor] = 0
        state.shock_ticks[actor] = LIE_TICKS
    elif state.kind[actor] < FIRST_OF_TWO_WHEELS:
        state.shock_ticks[actor] = SHOCK_TICKS


@kernel
def lie(state: State, actor: int) -> bool:
    """One tick of who lies, sliding first; returns whether it is time to take him away."""
    before = state.speed[actor]
    state.speed[actor] = max(before - SLIDE_MPS2 * TICK_S, 0.0)
    step_m = 0.5 * (before + state.speed[actor]) * TICK_S
    state.x[actor] += step_m * math.cos(state.yaw[actor])
    state.y[actor] += step_m * math.sin(state.yaw[actor])
    state.acceleration[actor] = (state.speed[actor] - before) / TICK_S
    if state.shock_ticks[actor] == 0:
        return True
    state.shock_ticks[actor] -= 1
    return False


@kernel
def pass_shocks(state: State, egos: int, vehicle_end: int) -> None:
    """Drivers who were hit and stand come to themselves; riders who lay long enough are gone."""
    for actor in range(egos, vehicle_end):
        if state.shock_ticks[actor] == 0 or state.speed[actor] > 0.0:
            continue
        state.shock_ticks[actor] -= 1
        if state.shock_ticks[actor] == 0 and state.walk_waiting[actor] == DOWN:
            take_away(state, actor)


@kernel
def take_away(state: State, actor: int) -> None:
    """Takes an actor off the road, with all that it holds there."""
    state.kind[actor] = ABSENT
    state.lane[actor] = -1
    state.grant[actor] = -1
    state.grant_steps[actor] = 0
    state.away[actor] = 0
    state.previous_lane[actor] = -1
    state.earlier_lanes[actor] = -1
    state.changing_from[actor] = -1
    state.walk_waiting[actor] = 0
    state.speed[actor] = 0.0
    state.acceleration[actor] = 0.0
    state.yaw_rate[actor] = 0.0
