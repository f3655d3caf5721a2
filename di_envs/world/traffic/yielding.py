"""Who is in the way of a vehicle that would enter a junction: grants of others, egos, a jam."""

from __future__ import annotations

from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, LightState, SignalKind, Signals
from di_envs.town.queries import project_to_lane
from di_envs.world.state import OCCUPIED_LANES, PATH_LANES, TICK_S, State
from di_envs.world.traffic.approach import MOVING_MPS
from di_envs.world.traffic.occupancy import Occupancy

EGO_TURN_TICKS = round(6.0 / TICK_S)  # for which others let an ego that came first go first
EXIT_MARGIN_M = 3.0

_GREEN = int(LightState.GREEN)
_LIGHT = int(SignalKind.LIGHT)


@kernel
def _rear_on(state: State, lanes: Lanes, actor: int, lane: int) -> float:
    """Station of a vehicle's rear on a junction lane of its path: negative before it."""
    s = state.lane_m[actor] - state.half_length[actor]
    if state.lane[actor] == lane:
        return s
    if state.previous_lane[actor] == lane:
        return lanes.length_m[lane] + s
    return -1.0


@kernel
def crosses_holder(occupancy: Occupancy, state: State, lanes: Lanes, way: int, actor: int) -> bool:
    """Whether a vehicle with a grant is still before or in a place where `way` meets its own."""
    for k in range(lanes.conflict_start[way], lanes.conflict_start[way + 1]):
        other = lanes.conflict_lane[k]
        if _same_approach(lanes, way, other):
            continue
        holder = occupancy.holder[other]
        while holder >= 0:
            if (
                holder != actor
                and _rear_on(state, lanes, holder, other) < (lanes.conflict_other_end_m[k])
            ):
                return True
            holder = occupancy.next_holder[holder]
        if _crosses_leaver(occupancy, state, lanes, other, lanes.conflict_other_end_m[k], actor):
            return True
    return False


@kernel
def _crosses_leaver(
    occupancy: Occupancy, state: State, lanes: Lanes, other: int, end_m: float, actor: int
) -> bool:
    """Whether the tail of a vehicle that goes on to a near junction is still before station end."""
    leaver = occupancy.leaver[other]
    while leaver >= 0:
        rear = lanes.length_m[other] + state.leaving_m[leaver] - state.half_length[leaver]
        if leaver != actor and rear < end_m:
            return True
        leaver = occupancy.next_leaver[leaver]
    return False


@kernel
def _same_approach(lanes: Lanes, a: int, b: int) -> bool:
    """Whether two junction lanes begin at the same approach lane: followers see each other."""
    for i in range(lanes.predecessor_start[a], lanes.predecessor_start[a + 1]):
        for j in range(lanes.predecessor_start[b], lanes.predecessor_start[b + 1]):
            if lanes.predecessor[i] == lanes.predecessor[j]:
                return True
    return False


@kernel
def ways_conflict(lanes: Lanes, way: int, other: int) -> bool:
    """Whether two junction lanes meet (or are the same)."""
    if way == other:
        return True
    for k in range(lanes.conflict_start[way], lanes.conflict_start[way + 1]):
        if lanes.conflict_lane[k] == other:
            return True
    return False


@kernel
def ego_in_the_way(
    state: State,
    lanes: Lanes,
    signals: Signals,
    egos: int,
    way: int,
    actor: int,
    ranks_after_priority: bool,
) -> bool:
    """Whether an ego lies before or in a place where `way` meets the lanes it may be driving."""
    for ego in range(egos):
        for k in range(OCCUPIED_LANES):
            lane = state.occupied[ego, k]
            if lane < 0:
                break
            if lanes.junction[lane] >= 0:
                if _ego_meets(state, lanes, way, lane, ego):
                    return True
            elif _ego_comes_first(
                state, lanes, signals, way, lane, ego, actor, ranks_after_priority
            ):
                return True
    return False


@kernel
def _ego_meets(state: State, lanes: Lanes, way: int, lane: int, ego: int) -> bool:
    """Whether an ego on a junction lane is before or in a place where `way` meets it."""
    if lane == way:
        return False  # it is ahead on the same way: a leader, not a crossing
    for k in range(lanes.conflict_start[way], lanes.conflict_start[way + 1]):
        if lanes.conflict_lane[k] == lane:
            s, _ = project_to_lane(lanes, lane, state.x[ego], state.y[ego])
            if s - state.half_length[ego] < lanes.conflict_other_end_m[k]:
                return True
    return False


@kernel
def _ego_comes_first(
    state: State,
    lanes: Lanes,
    signals: Signals,
    way: int,
    approach: int,
    ego: int,
    actor: int,
    ranks_after_priority: bool,
) -> bool:
    """Whether an ego at the end of an approach lane has its turn before the vehicle."""
    s, _ = project_to_lane(lanes, approach, state.x[ego], state.y[ego])
    front = lanes.length_m[approach] - s - state.half_length[ego]
    line = lanes.stop_line[approach]
    signal = signals.stop_signal[line] if line >= 0 else -1
    if signal >= 0 and signals.kind[signal] != _LIGHT:
        came = state.arrival_tick[ego]
        earlier = came >= 0 and (state.arrival_tick[actor] < 0 or came < state.arrival_tick[actor])
        if not earlier or state.tick[()] - came > EGO_TURN_TICKS:
            return False
    else:
        if signal >= 0 and state.light[signal] != _GREEN:
            return False
        if not ranks_after_priority or state.speed[ego] < MOVING_MPS:
            return False
        if front > 5.0 + 4.0 * state.speed[ego]:
            return False
    for k in range(lanes.successor_start[approach], lanes.successor_start[approach + 1]):
        other = lanes.successor[k]
        if other != way and ways_conflict(lanes, way, other):
            return True
    return False


@kernel
def exit_has_room(
    occupancy: Occupancy, state: State, lanes: Lanes, actor: int, way_step: int
) -> bool:
    """Whether the vehicle would fit behind the last body beyond the junction."""
    need = 2.0 * state.half_length[actor] + EXIT_MARGIN_M
    beyond = way_step
    while beyond < PATH_LANES and (
        state.path[actor, beyond] >= 0 and lanes.junction[state.path[actor, beyond]] >= 0
    ):
        beyond += 1
    if beyond >= PATH_LANES or state.path[actor, beyond] < 0:
        return True
    exit_lane = state.path[actor, beyond]
    for k in range(lanes.predecessor_start[exit_lane], lanes.predecessor_start[exit_lane + 1]):
        holder = occupancy.holder[lanes.predecessor[k]]
        while holder >= 0:
            if holder != actor and state.lane[holder] != exit_lane:
                need += 2.0 * state.half_length[holder] + EXIT_MARGIN_M
            holder = occupancy.next_holder[holder]
    offset = 0.0
    for step in range(beyond, PATH_LANES):
        lane = state.path[actor, step]
        if lane < 0 or offset >= need:
            return True
        body = occupancy.first[lane]
        if body >= 0:
            speed = occupancy.speed[body]
            room = offset + occupancy.rear_m[body] + speed * speed / 8.0
            return room >= need
        offset += lanes.length_m[lane]
    return True
