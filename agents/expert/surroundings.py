"""What the expert's kernels read of a world: few arrays, so that they compile and start quickly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Float64, Int8, Int32
from di_envs.town.lanes import Lanes, Signals
from di_envs.world.lights import GREEN_TICKS, YELLOW_TICKS
from di_envs.world.state import State

LASTING_TICKS = 100_000  # for which a green that somebody forces is taken to last


class Actors(NamedTuple):
    """The actors (A,), as in `State`."""

    kind: Int8
    x: Float64
    y: Float64
    z: Float64
    yaw: Float64
    speed: Float64
    half_length: Float64
    half_width: Float64
    lane: Int32
    lane_m: Float64
    lateral_m: Float64
    path: Int32  # (A, PATH_LANES)
    previous_lane: Int32
    changing_from: Int32
    grant: Int32
    walk_edge: Int32


class Ways(NamedTuple):
    """The lanes' lengths, junctions and meeting places, as in `Lanes`."""

    junction: Int32
    length_m: Float64
    predecessor_start: Int32
    predecessor: Int32
    conflict_start: Int32
    conflict_lane: Int32
    conflict_begin_m: Float64
    conflict_end_m: Float64
    conflict_other_begin_m: Float64
    conflict_other_end_m: Float64


class Lights(NamedTuple):
    """What lights show (S,), and since when their junctions' turns run (J,)."""

    light: Int8
    junction: Int32
    phase_ticks: Int32


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
