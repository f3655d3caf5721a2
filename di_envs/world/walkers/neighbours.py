"""Which walkers are near a place, by cell: so that a crowd of twice as many costs twice as much."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.world.state import ActorKind, State

CELL_M = 2.0  # neighbours are looked for up to so far, less what somebody moves in a tick
SIDE = 32  # cells; places 64 m apart share one, and are told apart by their distance
WALKER = int(ActorKind.WALKER)


@by_reference
class Neighbours(NamedTuple):
    """Scratch of one tick: walkers as linked lists by cell, as they stood when it began."""

    first: NDArray[np.int32]  # (SIDE * SIDE,) first walker of a cell, -1 for none
    next: NDArray[np.int32]  # (A,) the next one in the same cell, -1 for none


def make_neighbours(actors: int) -> Neighbours:
    """Allocates the scratch."""
    return Neighbours(
        first=np.full(SIDE * SIDE, -1, np.int32), next=np.full(max(actors, 1), -1, np.int32)
    )


@kernel
def cell_at(x: float, y: float, right: int, down: int) -> int:
    """The cell so many columns and rows beside that of a place (x, y) [m], world frame."""
    column = (math.floor(x / CELL_M) + right) % SIDE
    row = (math.floor(y / CELL_M) + down) % SIDE
    return row * SIDE + column


@kernel
def fill_neighbours(near: Neighbours, state: State, first: int, end: int) -> None:
    """Sorts the walkers among the actors [first, end) into cells, each list by their ids."""
    near.first[:] = -1
    for back in range(end - first):
        walker = end - 1 - back
        if state.kind[walker] == WALKER:
            cell = cell_at(state.x[walker], state.y[walker], 0, 0)
            near.next[walker] = near.first[cell]
            near.first[cell] = walker
