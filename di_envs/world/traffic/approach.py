"""What a vehicle meets at the end of its lane: the way ahead, the line, the light or the sign."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, LightState, SignalKind, Signals, Turn
from di_envs.world.lights import GREEN_TICKS, YELLOW_TICKS
from di_envs.world.state import PATH_LANES, TAIL_LANES, TICK_S, State
from di_envs.world.traffic.car_following import NO_LEADER_M

YELLOW_BRAKING_MPS2 = 4.0  # harder than this nobody brakes for a yellow light …
RED_BRAKING_MPS2 = 5.5  # … unless it would be red by the time that they come to the line
SLOWING_MPS2 = 2.0  # with which they may slow down on the way to it, for a bend
STOP_ZONE_M = 4.0  # a stop counts with the front this close to the line
PATIENCE_TICKS = round(30.0 / TICK_S)  # after which a vehicle at a sign is let in by the others
MOVING_MPS = 0.5
STANDING_ROOM_M = 2.0  # between two junctions, beyond a vehicle's length, for it to wait there

_GREEN, _YELLOW = int(LightState.GREEN), int(LightState.YELLOW)
_LIGHT, _STOP = int(SignalKind.LIGHT), int(SignalKind.STOP)
_LEFT = int(Turn.LEFT)


@by_reference
class Requests(NamedTuple):
    """Scratch of one tick: what each vehicle approaches, and who asks to enter."""

    line_m: NDArray[np.float64]  # (A,) from the front to where it must stop, or NO_LEADER_M
    way: NDArray[np.int32]  # (A,) junction lane ahead that it has no grant for, -1 for none near
    way_step: NDArray[np.int32]  # (A,) its place in the vehicle's path
    way_end: NDArray[np.int32]  # (A,) place of the last junction lane that goes with it
    shut: NDArray[np.int8]  # (A,) 1 for whose exit has no room, 2 in whose way somebody is
    queue: NDArray[np.int32]  # (A,) those who ask, in order of their turn
    rank: NDArray[np.int64]  # (A,) the order: priority, then arrival


def make_requests(actors: int) -> Requests:
    """Allocates the scratch for `actors` actors."""
    return Requests(
        line_m=np.full(actors, NO_LEADER_M),
        way=np.full(actors, -1, np.int32),
        way_step=np.zeros(actors, np.int32),
        way_end=np.zeros(actors, np.int32),
        shut=np.zeros(actors, np.int8),
        queue=np.zeros(actors, np.int32),
        rank=np.zeros(actors, np.int64),
    )


@kernel
def find_entry(
    state: State, lanes: Lanes, actor: int, first: int, look_m: float
) -> tuple[int, float]:
    """The next junction lane on a vehicle's path by which it comes into a junction.

    Args:
        first: Place in the path from which on to look.
        look_m: How far before its front to look.

    Returns:
        (its place in the path, distance from the front to its line [m]), or (-1, NO_LEADER_M) if
        there is none within `look_m`. The distance is negative once the front is past the line.
    """
    before = state.lane[actor]
    distance = lanes.length_m[before] - state.lane_m[actor] - state.half_length[actor]
    for step in range(1, PATH_LANES):
        lane = state.path[actor, step]
        if lane < 0 or distance > look_m:
            break
        if step >= first and lanes.junction[lane] >= 0:
            if lanes.junction[lane] != lanes.junction[before]:
                return step, distance
        before = lane
        distance += lanes.length_m[lane]
    return -1, NO_LEADER_M


@kernel
def run_end(state: State, lanes: Lanes, actor: int, first: int) -> int:
    """Place in the path of the last junction lane that a vehicle must be granted with the first.

    Where it could not stand between a junction and the next one without blocking the first, it
    needs both, and so on: nobody may wait inside a junction for another.
    """
    room = 2.0 * state.half_length[actor] + STANDING_ROOM_M
    last, between = first, 0.0
    for step in range(first + 1, PATH_LANES):
        lane = state.path[actor, step]
        if lane < 0:
            break
        if lanes.junction[lane] >= 0:
            last, between = step, 0.0
            continue
        between += lanes.length_m[lane]
        if between >= room:
            break
    return last


@kernel
def lane_behind(state: State, actor: int, step: int) -> int:
    """The lane that a vehicle has left last (step 0), the one before it (1), …; or -1."""
    if step == 0:
        return as_int64(state.previous_lane[actor])
    return as_int64(state.earlier_lanes[actor, step - 1])


@kernel
def is_over_junction(state: State, lanes: Lanes, actor: int) -> bool:
    """Whether any part of a vehicle behind its middle, or the middle, is in a junction."""
    if lanes.junction[state.lane[actor]] >= 0:
        return True
    s = state.lane_m[actor]
    for step in range(TAIL_LANES + 1):
        lane = lane_behind(state, actor, step)
        if lane < 0 or s >= state.half_length[actor]:
            return False
        if lanes.junction[lane] >= 0:
            return True
        s += lanes.length_m[lane]
    return False


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
    """0 goes before 1 (turns left across others) before 2 (has a sign); patience ends.

    At lights turns end it: there who turns left goes on giving way.
    """
    line = lanes.stop_line[approach]
    if line >= 0 and signals.kind[signals.stop_signal[line]] == _LIGHT:
        return 1 if lanes.turn[way] == _LEFT else 0
    if waited_ticks > PATIENCE_TICKS:
        return 0
    return 2 if line >= 0 else (1 if lanes.turn[way] == _LEFT else 0)


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
def lane_before_junction(lanes: Lanes, lane: int, room: float) -> tuple[int, float]:
    """The last lane before the junction to which a lane leads, as long as there is no fork.

    Returns:
        (that lane, `room` [m], which is up to the end of `lane`, up to the end of that one).
    """
    for _ in range(PATH_LANES):
        first = lanes.successor_start[lane]
        if lanes.successor_start[lane + 1] != first + 1:
            break
        ahead = lanes.successor[first]
        if lanes.junction[ahead] >= 0:
            break
        room += lanes.length_m[ahead]
        if room > 4.0 * STOP_ZONE_M:
            break
        lane = ahead
    return as_int64(lane), room


@kernel
def note_ego_arrival(state: State, lanes: Lanes, ego: int) -> None:
    """Remembers since when an ego has stood, and stood first at a stop line, as vehicles do."""
    stands = state.speed[ego] < MOVING_MPS
    state.still_ticks[ego] = state.still_ticks[ego] + 1 if stands else 0
    lane = state.lane[ego]
    if lane < 0 or lanes.junction[lane] >= 0:
        state.arrival_tick[ego] = -1
        return
    front = lanes.length_m[lane] - state.lane_m[ego] - state.half_length[ego]
    _, front = lane_before_junction(lanes, lane, front)
    if front > 2.0 * STOP_ZONE_M:
        state.arrival_tick[ego] = -1
    elif state.arrival_tick[ego] < 0 and stands:
        state.arrival_tick[ego] = state.tick[()]
