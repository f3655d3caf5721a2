"""What a vehicle meets at the end of its lane: the way ahead, the line, the light or the sign."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, LightState, SignalKind, Signals, Turn
from di_envs.world.lights import GREEN_TICKS, YELLOW_TICKS
from di_envs.world.state import PATH_LANES, TICK_S, State

YELLOW_BRAKING_MPS2 = 4.0  # harder than this nobody brakes for a yellow light …
RED_BRAKING_MPS2 = 5.5  # … unless it would be red by the time that they come to the line
SLOWING_MPS2 = 2.0  # with which they may slow down on the way to it, for a bend
STOP_ZONE_M = 4.0  # a stop counts with the front this close to the line
PATIENCE_TICKS = round(30.0 / TICK_S)  # after which a vehicle at a sign is let in by the others
MOVING_MPS = 0.5

_GREEN, _YELLOW = int(LightState.GREEN), int(LightState.YELLOW)
_LIGHT, _STOP = int(SignalKind.LIGHT), int(SignalKind.STOP)
_LEFT = int(Turn.LEFT)


@by_reference
class Requests(NamedTuple):
    """Scratch of one tick: what each vehicle approaches, and who asks to enter."""

    distance_m: NDArray[np.float64]  # (A,) from the front to the stop line, negative once past it
    way: NDArray[np.int32]  # (A,) junction lane ahead, -1 for none near
    way_step: NDArray[np.int32]  # (A,) its place in the vehicle's path
    full: NDArray[np.int8]  # (A,) 1 for who may not go because the exit has no room
    queue: NDArray[np.int32]  # (A,) those who ask, in order of their turn
    rank: NDArray[np.int64]  # (A,) the order: priority, then arrival


def make_requests(actors: int) -> Requests:
    """Allocates the scratch for `actors` actors."""
    return Requests(
        distance_m=np.zeros(actors),
        way=np.full(actors, -1, np.int32),
        way_step=np.zeros(actors, np.int32),
        full=np.zeros(actors, np.int8),
        queue=np.zeros(actors, np.int32),
        rank=np.zeros(actors, np.int64),
    )


@kernel
def find_approach(
    requests: Requests, state: State, lanes: Lanes, actor: int, look_m: float
) -> None:
    """Notes the next junction lane on a vehicle's path that it is not yet on, within `look_m`."""
    requests.way[actor] = -1
    distance = lanes.length_m[state.lane[actor]] - state.lane_m[actor] - state.half_length[actor]
    inside = lanes.junction[state.lane[actor]] >= 0
    for step in range(1, PATH_LANES):
        lane = state.path[actor, step]
        if lane < 0 or distance > look_m:
            return
        if lanes.junction[lane] >= 0 and not inside:
            requests.way[actor] = lane
            requests.way_step[actor] = step
            requests.distance_m[actor] = distance
            return
        inside = lanes.junction[lane] >= 0
        distance += lanes.length_m[lane]


@kernel
def must_stop(state: State, lanes: Lanes, signals: Signals, actor: int, approach: int) -> bool:
    """Whether the signal at the end of an approach lane keeps a vehicle from asking to enter."""
    line = lanes.stop_line[approach]
    if line < 0:
        return False
    signal = signals.stop_signal[line]
    if signals.kind[signal] == _LIGHT:
        return state.light[signal] != _GREEN
    if signals.kind[signal] == _STOP:
        return state.stopped_at[actor] != line
    return False


@kernel
def priority_of(
    state: State, lanes: Lanes, signals: Signals, approach: int, way: int, waited_ticks: int
) -> int:
    """0 goes before 1 (turns left across others) before 2 (has a sign); patience ends."""
    line = lanes.stop_line[approach]
    if line >= 0 and signals.kind[signals.stop_signal[line]] != _LIGHT:
        return 0 if waited_ticks > PATIENCE_TICKS else 2
    return 1 if lanes.turn[way] == _LEFT else 0


@kernel
def yellow_left_s(state: State, lanes: Lanes, signals: Signals, approach: int) -> float:
    """Seconds until the light at the end of an approach lane is red; 0 once it is, and at signs."""
    signal = signals.stop_signal[lanes.stop_line[approach]]
    if state.light[signal] != _YELLOW:
        return 0.0
    junction = signals.junction[signal]
    if state.held_by[junction] > 0:
        return max(state.held_until[junction] - state.tick[()], 0) * TICK_S
    ticks = state.phase_ticks[junction]
    return (GREEN_TICKS + YELLOW_TICKS - ticks) * TICK_S


@kernel
def can_stop(speed: float, distance: float, yellow_left_s: float) -> bool:
    """Whether a vehicle can still stop before its line, hard if it would come there at red."""
    if speed < 1.0:
        return distance > 0.1 * speed
    reach = (speed - 0.5 * SLOWING_MPS2 * yellow_left_s) * yellow_left_s
    braking = YELLOW_BRAKING_MPS2 if distance < reach else RED_BRAKING_MPS2
    return distance > speed * speed / (2.0 * braking) + 0.5


@kernel
def note_stop(
    state: State,
    lanes: Lanes,
    signals: Signals,
    actor: int,
    approach: int,
    distance: float,
    tick: int,
) -> None:
    """Remembers when a vehicle, `distance` before the line, came there, and that it stopped."""
    if distance < 15.0 and state.arrival_tick[actor] < 0:
        state.arrival_tick[actor] = tick
    if state.speed[actor] < 0.1 and distance < STOP_ZONE_M:
        state.stopped_at[actor] = lanes.stop_line[approach]


@kernel
def note_ego_arrival(state: State, lanes: Lanes, ego: int) -> None:
    """Remembers since when an ego has stood first at a stop line, as it does for vehicles."""
    lane = state.lane[ego]
    if lane < 0 or lanes.junction[lane] >= 0:
        state.arrival_tick[ego] = -1
        return
    front = lanes.length_m[lane] - state.lane_m[ego] - state.half_length[ego]
    if front > 2.0 * STOP_ZONE_M:
        state.arrival_tick[ego] = -1
    elif state.arrival_tick[ego] < 0 and state.speed[ego] < MOVING_MPS:
        state.arrival_tick[ego] = state.tick[()]
