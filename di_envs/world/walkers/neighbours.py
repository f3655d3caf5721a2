"""Which walkers are near a place, by cell: so that a crowd of twice as many costs twice as much."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.world.state import ActorKind, State

CELL_M = 3.0
WITHIN_M = 1.4  # neighbours are looked for, less what they move in a tick: at most four cells
SIDE = 32  # cells; places 96 m apart share one, and are told apart by their distance
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
def cell_of(column: int, row: int) -> int:
    """The cell of a column and a row of the plane."""
    return (row % SIDE) * SIDE + column % SIDE


@kernel
def cells_around(x: float, y: float) -> tuple[int, int, int, int]:
    """Columns [begin, end) and rows [begin, end) within reach of a place [m], world frame."""
    return (
        math.floor((x - WITHIN_M) / CELL_M),
        math.floor((x + WITHIN_M) / CELL_M) + 1,
        math.floor((y - WITHIN_M) / CELL_M),
        math.floor((y + WITHIN_M) / CELL_M) + 1,
    )


@kernel
def fill_neighbours(near: Neighbours, state: State, first: int, end: int) -> None:
    """Sorts the walkers among the actors [first, end) into cells, each list by their ids."""
    near.first[:] = -1
    for back in range(end - first):
        walker = end - 1 - back
        if state.kind[walker] == WALKER:
            x, y = state.x[walker], state.y[walker]
            cell = cell_of(math.floor(x / CELL_M), math.floor(y / CELL_M))
            near.next[walker] = near.first[cell]
            near.first[cell] = walker
