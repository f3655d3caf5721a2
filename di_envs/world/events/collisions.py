"""Which contacts of an ego count as collisions: the de-duplication of Leaderboard 1.0, and ours.

Bodies that stay against each other have met once: only the impact counts, not the leaning. Beside
what CARLA's rule counts, each body is recorded when an ego touches it for the first time.
"""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel
from di_envs.world.events.rows import record
from di_envs.world.state import COLLISION_MEMORY, TICK_S, ActorKind, EventKind, State

MEMORY_TICKS = round(5.0 / TICK_S)  # for which the last actor hit is remembered
SAME_PLACE_M = 3.0  # from a remembered place, within which nothing counts
FORGET_PLACE_M = 5.0  # from it, beyond which it is forgotten
APART_TICKS = round(1.0 / TICK_S)  # without touching, after which two bodies meet anew
TOUCHED, COUNTED = 1, 2  # `state.hit`

WALKER, PROP = int(ActorKind.WALKER), int(ActorKind.PROP)
# of each the kinds for a vehicle and for what is lifeless follow, in this order
HIT_WALKER = int(EventKind.COLLISION_WALKER)
FIRST_HIT_WALKER = int(EventKind.FIRST_HIT_WALKER)


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
def is_impact(state: State, ego: int, other: int) -> bool:
    """Whether bodies that touch now were apart before: a contact begins, and does not go on."""
    last = state.contact_tick[ego, other]
    return last == 0 or state.tick[()] - last > APART_TICKS


@kernel
def count_contact(state: State, ego: int, other: int, out: Float64, n: int) -> int:
    """Records what a contact counts as: a collision by CARLA's rule once, a first hit once ever.

    Returns:
        The number of rows of `out` in use.
    """
    if is_impact(state, ego, other):
        again = state.last_collision_actor[ego] == other  # within 5 s: part of that collision
        if state.hit[ego, other] == 0 and state.finished[ego] == 0:
            x, y, z = state.x[ego], state.y[ego], state.z[ego]
            kind = FIRST_HIT_WALKER + _class_of(state, other)
            n = record(out, n, kind, ego, int(state.tick[()]), x, y, z, other, 0.0)
        state.hit[ego, other] = COUNTED if again else TOUCHED
    state.contact_tick[ego, other] = state.tick[()]
    if state.hit[ego, other] == TOUCHED and state.finished[ego] == 0:
        before = n
        n = _count_collision(state, ego, other, out, n)
        if n > before:
            state.hit[ego, other] = COUNTED
    return n


@kernel
def _class_of(state: State, other: int) -> int:
    """0 for a walker, 1 for a vehicle, 2 for what is lifeless."""
    if state.kind[other] == WALKER:
        return 0
    return 2 if state.kind[other] >= PROP else 1


@kernel
def _count_collision(state: State, ego: int, other: int, out: Float64, n: int) -> int:
    """Records a contact, unless it is near the place of another.

    The ego's own speed plays no part: being hit while standing counts in 1.0. As the place is the
    ego's, at most one collision counts in a tick.

    Returns:
        The number of rows of `out` in use.
    """
    x, y, z = state.x[ego], state.y[ego], state.z[ego]
    for k in range(COLLISION_MEMORY):  # a free slot is NaN, and near nothing
        dx, dy = state.collision_places[ego, k, 0] - x, state.collision_places[ego, k, 1] - y
        if dx * dx + dy * dy <= SAME_PLACE_M * SAME_PLACE_M:
            return n
    _remember(state, ego, other)
    kind = HIT_WALKER + _class_of(state, other)
    return record(out, n, kind, ego, int(state.tick[()]), x, y, z, other, 0.0)
