"""When a walker may step onto a crosswalk, and what stops one who is on it."""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Float64
from di_envs.numerics.geometry import boxes_overlap
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import LightState, Signals
from di_envs.world.bodies import SAME_LEVEL_M
from di_envs.world.lights import TURN_TICKS
from di_envs.world.state import TICK_S, State
from di_envs.world.walkers.neighbours import (
    LOOK_S,
    Neighbours,
    cell_of,
    is_vehicle,
    stretches_around,
    way_ahead_m,
)
from di_envs.world.walkers.walk_graph import WalkGraph

COMFORTABLE_MPS2 = 2.5  # braking that walkers expect of drivers …
REACTION_S = 0.7  # … after this time …
ROOM_M = 3.0  # … to a stop this far before the strip
STANDS_MPS = 0.3  # a vehicle slower than this is taken to stand
SPARE_TICKS = round(1.0 / TICK_S)  # of red left when a walker has crossed
BODY_M = 0.25  # half a walker's width

RED = int(LightState.RED)


@kernel
def ticks_to_green(signals: Signals, signal: int, phase_group: int, phase_ticks: int) -> int:
    """Ticks until a light that is red turns green; phases are those of its junction."""
    groups = signals.groups[signals.junction[signal]]
    turns = (signals.group[signal] - phase_group) % groups
    if turns == 0:  # its own turn is at its end
        turns = groups
    return turns * TURN_TICKS - phase_ticks


@kernel
def _lights_hold(
    state: State, walk: WalkGraph, signals: Signals, crosswalk: int, needed_ticks: int
) -> bool:
    """Whether every light of the crossed arm is red, and stays so for long enough.

    Nobody knows how long a light that is forced stays as it is.
    """
    for k in range(walk.light_start[crosswalk], walk.light_start[crosswalk + 1]):
        signal = walk.light[k]
        junction = signals.junction[signal]
        if state.light[signal] != RED or state.forced_light[signal] != 0:
            return False
        left = ticks_to_green(
            signals, signal, state.phase_group[junction], state.phase_ticks[junction]
        )
        if left < needed_ticks + SPARE_TICKS:
            return False
    return True


@kernel
def is_on_strip(state: State, strip: Float64, actor: int) -> bool:
    """Whether an actor's box reaches onto a strip (6,): x, y, z, yaw, half length and width."""
    if abs(state.z[actor] - strip[2]) >= SAME_LEVEL_M:
        return False
    return boxes_overlap(
        strip[0],
        strip[1],
        strip[3],
        strip[4],
        strip[5],
        state.x[actor],
        state.y[actor],
        state.yaw[actor],
        state.half_length[actor],
        state.half_width[actor],
    )


@kernel
def could_stop(speed_mps: float, gap_m: float) -> bool:
    """Whether a vehicle could stop comfortably before a strip, or stands before it."""
    needed = speed_mps * speed_mps / (2.0 * COMFORTABLE_MPS2) + REACTION_S * speed_mps
    if speed_mps >= STANDS_MPS:
        needed += ROOM_M
    return gap_m >= needed


@kernel
def _goes_over(state: State, actor: int, lane: int) -> bool:
    """Whether a vehicle's chosen path has this lane; an ego's is unknown, so it might."""
    found = actor < state.throttle.size
    for k in range(state.path.shape[1]):
        found = found or state.path[actor, k] == lane
    return found


@kernel
def is_coming(state: State, walk: WalkGraph, crosswalk: int, actor: int) -> bool:
    """Whether a vehicle is heading for a strip, and not able to stop comfortably before it."""
    lane = state.lane[actor]
    if lane < 0:
        return False
    front = state.lane_m[actor] + state.half_length[actor]
    rear = state.lane_m[actor] - state.half_length[actor]
    for k in range(walk.approach_start[lane], walk.approach_start[lane + 1]):
        if walk.approach[k] != crosswalk or rear >= walk.approach_end_m[k]:
            continue
        if could_stop(state.speed[actor], walk.approach_begin_m[k] - front):
            continue
        if _goes_over(state, actor, walk.approach_lane[k]):
            return True
    return False


@kernel
def _is_occupied(state: State, walk: WalkGraph, near: Neighbours, crosswalk: int) -> bool:
    """Whether an ego or another vehicle reaches onto a strip."""
    strip = walk.strip[crosswalk]
    for ego in range(state.throttle.size):
        if is_vehicle(state.kind[ego]) and is_on_strip(state, strip, ego):
            return True
    within = strip[4] + strip[5] + near.longest_m[1]
    left, right, top, bottom = stretches_around(strip[0], strip[1], within)
    for row in range(top, bottom):
        for column in range(left, right):
            vehicle = near.first_vehicle[cell_of(column, row)]
            while vehicle >= 0:
                if is_on_strip(state, strip, vehicle):
                    return True
                vehicle = near.next_vehicle[vehicle]
    return False


@kernel
def _is_driven_at(state: State, walk: WalkGraph, near: Neighbours, crosswalk: int) -> bool:
    """Whether an ego or another vehicle is coming to a strip."""
    for ego in range(state.throttle.size):
        if is_vehicle(state.kind[ego]) and is_coming(state, walk, crosswalk, ego):
            return True
    for k in range(walk.leading_start[crosswalk], walk.leading_start[crosswalk + 1]):
        vehicle = near.first_on_lane[walk.leading[k]]
        while vehicle >= 0:
            if is_coming(state, walk, crosswalk, vehicle):
                return True
            vehicle = near.next_on_lane[vehicle]
    return False


@kernel
def may_cross(
    state: State,
    walk: WalkGraph,
    signals: Signals,
    near: Neighbours,
    crosswalk: int,
    needed_ticks: int,
) -> bool:
    """Whether a walker who needs so many ticks may step onto a crosswalk now."""
    if not _lights_hold(state, walk, signals, crosswalk, needed_ticks):
        return False
    if _is_driven_at(state, walk, near, crosswalk):
        return False
    return not _is_occupied(state, walk, near, crosswalk)


@kernel
def is_in_the_way(
    state: State,
    actor: int,
    x: float,
    y: float,
    z: float,
    heading: float,
    step_m: float,
    margin_m: float,
    look_s: float,
) -> bool:
    """Whether a step from (x, y) would go into a vehicle, or where it will be within `look_s`.

    Steps away from its middle are always free, so that nobody is held by a body beside them.
    """
    dx, dy = state.x[actor] - x, state.y[actor] - y
    half_length, look = state.half_length[actor], look_s * state.speed[actor]
    reach = way_ahead_m(state, actor, look_s)
    if abs(dx) > reach or abs(dy) > reach or abs(state.z[actor] - z) >= SAME_LEVEL_M:
        return False
    step_x, step_y = step_m * math.cos(heading), step_m * math.sin(heading)
    if dx * step_x + dy * step_y <= 0.0:
        return False
    cos, sin = math.cos(state.yaw[actor]), math.sin(state.yaw[actor])
    ahead = (step_x - dx) * cos + (step_y - dy) * sin
    right = (step_y - dy) * cos - (step_x - dx) * sin
    room = BODY_M + margin_m
    in_length = -half_length - room < ahead < half_length + look + room
    return in_length and abs(right) < state.half_width[actor] + room


@kernel
def is_blocked(
    state: State,
    near: Neighbours,
    on_road: bool,
    x: float,
    y: float,
    z: float,
    heading: float,
    step_m: float,
    margin_m: float,
) -> bool:
    """Whether somebody stands in, or drives into, a walker's next step.

    Egos may be anywhere, other vehicles only where he is on the road.
    """
    for ego in range(state.throttle.size):
        if is_vehicle(state.kind[ego]) and is_in_the_way(
            state, ego, x, y, z, heading, step_m, margin_m, LOOK_S
        ):
            return True
    if not on_road:
        return False
    left, right, top, bottom = stretches_around(x, y, near.longest_m[0])
    for row in range(top, bottom):
        for column in range(left, right):
            vehicle = near.first_vehicle[cell_of(column, row)]
            while vehicle >= 0:
                if is_in_the_way(state, vehicle, x, y, z, heading, step_m, margin_m, LOOK_S):
                    return True
                vehicle = near.next_vehicle[vehicle]
    return False
