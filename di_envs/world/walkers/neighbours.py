"""Who is near a place: so that a town with twice as many in it costs twice as much.

Walkers are found by cell; vehicles by cell and by lane. Egos are few, and looked at each.
"""

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
STRETCH_M = 32.0  # a side of a vehicle's cell
LOOK_S = 1.0  # of a vehicle's way ahead that walkers do not step into
AHEAD_M = 2.0  # beyond that, and beside a vehicle, nobody is in its way
WALKER = int(ActorKind.WALKER)
FIRST_VEHICLE, LAST_VEHICLE = int(ActorKind.CAR), int(ActorKind.BICYCLE)


@by_reference
class Neighbours(NamedTuple):
    """Scratch of one tick: linked lists; walkers as they stood when it began."""

    first: NDArray[np.int32]  # (SIDE * SIDE,) first walker of a cell, -1 for none
    next: NDArray[np.int32]  # (A,) the next one in the same cell, -1 for none
    first_vehicle: NDArray[np.int32]  # (SIDE * SIDE,) first vehicle of a cell, -1 for none
    next_vehicle: NDArray[np.int32]  # (A,)
    first_on_lane: NDArray[np.int32]  # (L,) first vehicle whose lane it is, -1 for none
    next_on_lane: NDArray[np.int32]  # (A,)
    # of all vehicles: how far from its middle one is in the way, and reaches, at most [m]
    longest_m: NDArray[np.float64]  # (2,)


def make_neighbours(actors: int, lanes: int) -> Neighbours:
    """Allocates the scratch."""
    cells, most = SIDE * SIDE, max(actors, 1)
    return Neighbours(
        first=np.full(cells, -1, np.int32),
        next=np.full(most, -1, np.int32),
        first_vehicle=np.full(cells, -1, np.int32),
        next_vehicle=np.full(most, -1, np.int32),
        first_on_lane=np.full(max(lanes, 1), -1, np.int32),
        next_on_lane=np.full(most, -1, np.int32),
        longest_m=np.zeros(2),
    )


@kernel
def is_vehicle(kind: int) -> bool:
    """Whether an actor of this kind is one that people look out for."""
    return FIRST_VEHICLE <= kind <= LAST_VEHICLE


@kernel
def cell_of(column: int, row: int) -> int:
    """The cell of a column and a row of the plane."""
    return (row % SIDE) * SIDE + column % SIDE


@kernel
def _cells(x: float, y: float, within_m: float, side_m: float) -> tuple[int, int, int, int]:
    """Columns [begin, end) and rows [begin, end) of the cells so near a place."""
    return (
        math.floor((x - within_m) / side_m),
        math.floor((x + within_m) / side_m) + 1,
        math.floor((y - within_m) / side_m),
        math.floor((y + within_m) / side_m) + 1,
    )


@kernel
def cells_around(x: float, y: float) -> tuple[int, int, int, int]:
    """Columns [begin, end) and rows [begin, end) within reach of a place [m], world frame."""
    return _cells(x, y, WITHIN_M, CELL_M)


@kernel
def stretches_around(x: float, y: float, within_m: float) -> tuple[int, int, int, int]:
    """The same of vehicles' cells, for those whose middles are so near a place [m]."""
    return _cells(x, y, within_m, STRETCH_M)


@kernel
def way_ahead_m(state: State, vehicle: int, look_s: float) -> float:
    """How far from its middle somebody may be in a vehicle's way within `look_s`, at most."""
    return state.half_length[vehicle] + look_s * state.speed[vehicle] + AHEAD_M


@kernel
def fill_neighbours(near: Neighbours, state: State, first: int, end: int) -> None:
    """Sorts walkers, the actors [first, end), and the vehicles before them that are no egos.

    Each list is in the order of their ids.
    """
    near.first[:] = -1
    for back in range(end - first):
        walker = end - 1 - back
        if state.kind[walker] == WALKER:
            x, y = state.x[walker], state.y[walker]
            cell = cell_of(math.floor(x / CELL_M), math.floor(y / CELL_M))
            near.next[walker] = near.first[cell]
            near.first[cell] = walker
    _fill_vehicles(near, state, first)


@kernel
def _fill_vehicles(near: Neighbours, state: State, end: int) -> None:
    near.first_vehicle[:] = -1
    near.first_on_lane[:] = -1
    longest = widest = 0.0
    egos = state.throttle.size
    for back in range(end - egos):
        vehicle = end - 1 - back
        if not is_vehicle(state.kind[vehicle]):
            continue
        x, y, lane = state.x[vehicle], state.y[vehicle], state.lane[vehicle]
        cell = cell_of(math.floor(x / STRETCH_M), math.floor(y / STRETCH_M))
        near.next_vehicle[vehicle] = near.first_vehicle[cell]
        near.first_vehicle[cell] = vehicle
        if lane >= 0:
            near.next_on_lane[vehicle] = near.first_on_lane[lane]
            near.first_on_lane[lane] = vehicle
        longest = max(longest, way_ahead_m(state, vehicle, LOOK_S))
        widest = max(widest, state.half_length[vehicle] + state.half_width[vehicle])
    near.longest_m[0], near.longest_m[1] = longest, widest
