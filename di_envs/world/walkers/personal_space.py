"""Walkers keep out of each other's way: nobody steps into another."""

from __future__ import annotations

from di_envs.numerics.kernels import kernel
from di_envs.world.bodies import SAME_LEVEL_M
from di_envs.world.state import ActorKind, State

CLEAR_M = 0.75  # between two middles: more than the diagonal of a body's square, 0.71

WALKER = int(ActorKind.WALKER)


@kernel
def step_is_free(state: State, walker: int, first: int, end: int, x: float, y: float) -> bool:
    """Whether a walker may step to (x, y): it comes near nobody, or leads away from who is near.

    The walkers are the actors [first, end).
    """
    here_x, here_y = state.x[walker], state.y[walker]
    xs, ys = state.x, state.y
    for other in range(first, end):
        dx, dy = xs[other] - x, ys[other] - y
        after = dx * dx + dy * dy
        if after >= CLEAR_M * CLEAR_M or other == walker or state.kind[other] != WALKER:
            continue
        dx, dy = xs[other] - here_x, ys[other] - here_y
        if after < dx * dx + dy * dy and abs(state.z[other] - state.z[walker]) < SAME_LEVEL_M:
            return False
    return True
