"""Which contacts of an ego count as collisions: the de-duplication of Leaderboard 1.0."""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel
from di_envs.world.events.rows import record
from di_envs.world.state import COLLISION_MEMORY, TICK_S, ActorKind, EventKind, State

MEMORY_TICKS = round(5.0 / TICK_S)  # for which the last actor hit is remembered
SAME_PLACE_M = 3.0  # from a remembered place, within which nothing counts
FORGET_PLACE_M = 5.0  # from it, beyond which it is forgotten

WALKER, PROP = int(ActorKind.WALKER), int(ActorKind.PROP)
HIT_WALKER = int(EventKind.COLLISION_WALKER)
HIT_VEHICLE = int(EventKind.COLLISION_VEHICLE)
HIT_STATIC = int(EventKind.COLLISION_STATIC)


@kernel
def forget_collisions(state: State, ego: int) -> None:
    """Drops the last actor after 5 s and each place once the ego is more than 5 m from it."""
    if state.tick[()] - state.last_collision_tick[ego] > MEMORY_TICKS:
        state.last_collision_actor[ego] = -1
    places = state.collision_places[ego]
    kept = 0  # places stay in order of age, the free slots behind them
    for k in range(COLLISION_MEMORY):
        place_x, place_y = places[k, 0], places[k, 1]
        places[k, 0] = places[k, 1] = math.nan
        if (place_x - state.x[ego]) ** 2 + (place_y - state.y[ego]) ** 2 <= FORGET_PLACE_M**2:
            places[kept, 0], places[kept, 1] = place_x, place_y
            kept += 1


@kernel
def _remember(state: State, ego: int, other: int) -> None:
    """Notes whom an ego has hit, when, and where it was."""
    state.last_collision_actor[ego] = other
    state.last_collision_tick[ego] = state.tick[()]
    places = state.collision_places[ego]
    free = 0
    while free < COLLISION_MEMORY and not math.isnan(places[free, 0]):
        free += 1
    if free == COLLISION_MEMORY:  # the oldest makes room
        free -= 1
        for k in range(free):
            places[k, 0], places[k, 1] = places[k + 1, 0], places[k + 1, 1]
    places[free, 0], places[free, 1] = state.x[ego], state.y[ego]


@kernel
def count_collision(state: State, ego: int, other: int, out: Float64, n: int) -> int:
    """Records a contact, unless it is with the last actor hit or near the place of another.

    The ego's own speed plays no part: being hit while standing counts in 1.0. As the place is the
    ego's, at most one collision counts in a tick.

    Returns:
        The number of rows of `out` in use.
    """
    if state.finished[ego] != 0 or state.last_collision_actor[ego] == other:
        return n
    x, y, z = state.x[ego], state.y[ego], state.z[ego]
    for k in range(COLLISION_MEMORY):  # a free slot is NaN, and near nothing
        dx, dy = state.collision_places[ego, k, 0] - x, state.collision_places[ego, k, 1] - y
        if dx * dx + dy * dy <= SAME_PLACE_M * SAME_PLACE_M:
            return n
    _remember(state, ego, other)
    kind = HIT_VEHICLE
    if state.kind[other] == WALKER:
        kind = HIT_WALKER
    elif state.kind[other] >= PROP:
        kind = HIT_STATIC
    return record(out, n, kind, ego, int(state.tick[()]), x, y, z, other, 0.0)
