"""Traffic lights: the arms of a junction take turns, one group at a time, the rest stay red.

While a scenario plays with a junction's lights its turns stand still; then they go on.

Source: CARLA's rule as its maintainers describe it (carla issues 7684 and 7738), with the times of
the example there: green 10 s, yellow 3 s, red 2 s.
"""

from __future__ import annotations

import numpy as np

from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, keyed_hash
from di_envs.town.lanes import LightState, SignalKind, Signals
from di_envs.world.state import TICK_S, State

GREEN_TICKS = round(10.0 / TICK_S)
YELLOW_TICKS = round(3.0 / TICK_S)
RED_TICKS = round(2.0 / TICK_S)
TURN_TICKS = GREEN_TICKS + YELLOW_TICKS + RED_TICKS

_LIGHT = int(SignalKind.LIGHT)
_NONE, _GREEN, _YELLOW, _RED = (int(state) for state in LightState)
_PHASE_STREAM = int(Stream.LIGHT_PHASE)


@kernel
def start_lights(state: State, signals: Signals) -> None:
    """Draws whose turn it is at each junction, and for how long it has been, from the seed."""
    for junction in range(signals.groups.size):
        groups = signals.groups[junction]
        if groups > 0:
            draw = keyed_hash(int(state.seed[()]), _PHASE_STREAM, 0, junction)
            state.phase_group[junction] = np.int32(draw % np.uint64(groups))
            state.phase_ticks[junction] = np.int32((draw >> np.uint64(20)) % np.uint64(TURN_TICKS))
    show_lights(state, signals)


@kernel
def advance_lights(state: State, signals: Signals) -> None:
    """One tick: turns end, the next group's begins, every head shows its colour."""
    for junction in range(signals.groups.size):
        if signals.groups[junction] > 0 and state.held_by[junction] == 0:
            state.phase_ticks[junction] += 1
            if state.phase_ticks[junction] >= TURN_TICKS:
                state.phase_ticks[junction] = 0
                following = state.phase_group[junction] + 1
                state.phase_group[junction] = following % signals.groups[junction]
    show_lights(state, signals)


@kernel
def show_lights(state: State, signals: Signals) -> None:
    """Sets each head's colour from its junction's phase, or as it is forced to."""
    for signal in range(signals.kind.size):
        if signals.kind[signal] != _LIGHT:
            state.light[signal] = _NONE
            continue
        if state.forced_light[signal] != _NONE:
            state.light[signal] = state.forced_light[signal]
            continue
        junction = signals.junction[signal]
        ticks = state.phase_ticks[junction]
        if state.phase_group[junction] != signals.group[signal] or ticks >= (
            GREEN_TICKS + YELLOW_TICKS
        ):
            state.light[signal] = _RED
        elif ticks >= GREEN_TICKS:
            state.light[signal] = _YELLOW
        else:
            state.light[signal] = _GREEN


@kernel
def hold_lights(state: State, signals: Signals, junction: int, holder: int) -> None:
    """Takes a junction's lights out of their turns: all red until `force_light` says otherwise.

    Args:
        state: The world.
        signals: The town's signals.
        junction: The junction.
        holder: 1 + the trigger that plays with them.
    """
    state.held_by[junction] = holder
    for signal in range(signals.kind.size):
        if signals.junction[signal] == junction and signals.kind[signal] == _LIGHT:
            state.forced_light[signal] = _RED


@kernel
def release_lights(state: State, signals: Signals, junction: int) -> None:
    """Gives a junction's lights back to their turns, which go on where they stood."""
    state.held_by[junction] = 0
    for signal in range(signals.kind.size):
        if signals.junction[signal] == junction:
            state.forced_light[signal] = _NONE
    show_lights(state, signals)
