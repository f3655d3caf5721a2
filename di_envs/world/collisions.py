# mypy: disallow_untyped_defs=False
"""Which contacts of an ego count as collisions: the de-duplication of Leaderboard 1.0."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.kernels import kernel
from di_envs.world.event_rows import record
from di_envs.world.state import COLLISION_MEMORY, TICK_S, ActorKind, EventKind

MEMORY_TICKS = round(5.0 / TICK_S)  # for which the last actor hit is remembered
SAME_PLACE_M = 3.0  # from a remembered place, within which nothing counts
FORGET_PLACE_M = 5.0  # from it, beyond which it is forgotten

WALKER, PROP = int(ActorKind.WALKER), int(ActorKind.PROP)
HIT_WALKER = int(EventKind.COLLISION_WALKER)
HIT_VEHICLE = int(EventKind.COLLISION_VEHICLE)
HIT_STATIC = int(EventKind.COLLISION_STATIC)


class CollisionMemory(NamedTuple):
    """What a state remembers of collisions, and the egos that still collect them."""

    actor: NDArray[np.int32]  # (E,) the last one hit
    tick: NDArray[np.int64]  # (E,) when
    places: NDArray[np.float64]  # (E, COLLISION_MEMORY, 2) where the ego was, oldest first
    finished: NDArray[np.int8]  # (E,)


@kernel
def forget_collisions(memory, ego, tick, x, y):
    """Drops the last actor after 5 s and each place once the ego is more than 5 m from it."""
    if tick - memory.tick[ego] > MEMORY_TICKS:
        memory.actor[ego] = -1
    places = memory.places[ego]
    kept = 0  # places stay in order of age, the free slots behind them
    for k in range(COLLISION_MEMORY):
        place_x, place_y = places[k, 0], places[k, 1]
        places[k, 0] = places[k, 1] = math.nan
        if (place_x - x) ** 2 + (place_y - y) ** 2 <= FORGET_PLACE_M**2:
            places[kept, 0], places[kept, 1] = place_x, place_y
            kept += 1


@kernel
def _remember(memory, ego, other, tick, x, y):
    memory.actor[ego] = other
    memory.tick[ego] = tick
    places = memory.places[ego]
    free = 0
    while free < COLLISION_MEMORY and not math.isnan(places[free, 0]):
        free += 1
    if free == COLLISION_MEMORY:  # the oldest makes room
        free -= 1
        for k in range(free):
            places[k, 0], places[k, 1] = places[k + 1, 0], places[k + 1, 1]
    places[free, 0], places[free, 1] = x, y


@kernel
def count_collision(memory, bodies, ego, other, tick, out, n):
    """Records a contact, unless it is with the last actor hit or near the place of another.

    The ego's own speed plays no part: being hit while standing counts in 1.0. As the place is the
    ego's, at most one collision counts in a tick.

    Returns:
        The number of rows of `out` in use.
    """
    if memory.finished[ego] != 0 or memory.actor[ego] == other:
        return n
    x, y, z = bodies.x[ego], bodies.y[ego], bodies.z[ego]
    for k in range(COLLISION_MEMORY):  # a free slot is NaN, and near nothing
        dx, dy = memory.places[ego, k, 0] - x, memory.places[ego, k, 1] - y
        if dx * dx + dy * dy <= SAME_PLACE_M * SAME_PLACE_M:
            return n
    _remember(memory, ego, other, tick, x, y)
    kind = HIT_VEHICLE
    if bodies.kind[other] == WALKER:
        kind = HIT_WALKER
    elif bodies.kind[other] == PROP:
        kind = HIT_STATIC
    return record(out, n, kind, ego, tick, x, y, z, other, 0.0)
