"""What the expert's kernels read of a world: few arrays, so that they compile and start quickly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import Lanes, Signals
from di_envs.world.lights import GREEN_TICKS, YELLOW_TICKS
from di_envs.world.state import State

LASTING_TICKS = 100_000  # for which a green that somebody forces is taken to last

Float = NDArray[np.float64]
Int = NDArray[np.int32]


class Actors(NamedTuple):
    """The actors (A,), as in `State`."""

    kind: NDArray[np.int8]
    x: Float
    y: Float
    z: Float
    yaw: Float
    speed: Float
    half_length: Float
    half_width: Float
    lane: Int
    lane_m: Float
    lateral_m: Float
    path: Int  # (A, PATH_LANES)
    previous_lane: Int
    changing_from: Int
    grant: Int
    walk_edge: Int


class Ways(NamedTuple):
    """The lanes' lengths, junctions and meeting places, as in `Lanes`."""

    junction: Int
    length_m: Float
    predecessor_start: Int
    predecessor: Int
    conflict_start: Int
    conflict_lane: Int
    conflict_begin_m: Float
    conflict_end_m: Float
    conflict_other_begin_m: Float
    conflict_other_end_m: Float


class Lights(NamedTuple):
    """What lights show (S,), and since when their junctions' turns run (J,)."""

    light: NDArray[np.int8]
    junction: Int
    phase_ticks: Int


def actors_of(state: State) -> Actors:
    """The actors of a state; views, not copies."""
    return Actors(*(getattr(state, name) for name in Actors._fields))


def ways_of(lanes: Lanes) -> Ways:
    """The part of the lanes that the expert reads; views, not copies."""
    return Ways(*(getattr(lanes, name) for name in Ways._fields))


def lights_of(state: State, signals: Signals) -> Lights:
    """The lights of a state; views, not copies, unless a scenario plays with some of them.

    Their turns then stand still: a forced yellow says when it ends, green is taken to last.
    """
    ticks = state.phase_ticks
    held = state.held_by > 0
    if held.any():
        left = state.held_until - state.tick
        until_red = np.where(left > 0, left, LASTING_TICKS)
        ticks = np.where(held, GREEN_TICKS + YELLOW_TICKS - until_red, ticks).astype(np.int32)
    return Lights(state.light, signals.junction, ticks)
