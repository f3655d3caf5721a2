"""Who is in the way of a vehicle that would enter a junction: grants of others, egos, a jam."""

from __future__ import annotations

import math

from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, LightState, SignalKind, Signals
from di_envs.town.queries import pose_at, project_to_lane
from di_envs.world.state import OCCUPIED_LANES, PATH_LANES, TICK_S, State
from di_envs.world.traffic.approach import (
    MOVING_MPS,
    can_stop,
    find_entry,
    lane_before_junction,
)
from di_envs.world.traffic.car_following import NO_LEADER_M
from di_envs.world.traffic.occupancy import Occupancy

EGO_TURN_TICKS = round(6.0 / TICK_S)  # for which others let an ego that came first go first
PASSING_M = 1.3  # half a wide vehicle, and a hand: from its lane to what it passes
EXIT_MARGIN_M = 3.0

_GREEN = int(LightState.GREEN)
_LIGHT = int(SignalKind.LIGHT)


@kernel
def crossing_claimant(
    occupancy: Occupancy, state: State, lanes: Lanes, way: int, actor: int, passed_m: float
) -> int:
    """Who is, or may come, before or in a place where `way` meets his lane; -1 for nobody.

    Of several the one who has stood longest. Places that end before station `passed_m` of the way,
    where the vehicle's rear is, do not count.
    """
    met = -1
    for k in range(lanes.conflict_start[way], lanes.conflict_start[way + 1]):
        other = lanes.conflict_lane[k]
        row = occupancy.claim[other]
        if row < 0 or lanes.conflict_end_m[k] < passed_m or _same_approach(lanes, way, other):
            continue
        while row >= 0:
            who = occupancy.claimant[row]
            if (
                who != actor
                and occupancy.claim_rear_m[row] < lanes.conflict_other_end_m[k]
                and occupancy.claim_front_m[row] > lanes.conflict_other_begin_m[k]
                and (met < 0 or state.still_ticks[who] > state.still_ticks[met])
            ):
                met = who
            row = occupancy.next_claim[row]
    return as_int64(met)


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
                passed_m = -NO_LEADER_M
                if state.lane[actor] == way:
                    passed_m = state.lane_m[actor] + state.half_length[actor]
                if _ego_meets(state, lanes, way, lane, ego, passed_m):
                    return True
            elif _ego_comes_first(
                state, lanes, signals, way, lane, ego, actor, ranks_after_priority
            ):
                return True
    return False


@kernel
def _ego_meets(state: State, lanes: Lanes, way: int, lane: int, ego: int, passed_m: float) -> bool:
    """Whether an ego on a junction lane is before or in a place where `way` meets it.

    Once it has stood, it counts only on lanes on which it lies: others do not wait for who waits
    for them, and drive past it where they can.
    Places that end before station `passed_m` of the way do not count.
    """
    if lane == way:
        return False  # it is ahead on the same way: a leader, not a crossing
    for k in range(lanes.conflict_start[way], lanes.conflict_start[way + 1]):
        if lanes.conflict_lane[k] == lane and lanes.conflict_end_m[k] > passed_m:
            s, _ = project_to_lane(lanes, lane, state.x[ego], state.y[ego])
            half = state.half_length[ego]
            if state.still_ticks[ego] > EGO_TURN_TICKS:
                if (
                    not _lies_on(state, lanes, ego, way)
                    or s + half < lanes.conflict_other_begin_m[k]
                ):
                    continue
            if s - half < lanes.conflict_other_end_m[k]:
                return True
    return False


@kernel
def _lies_on(state: State, lanes: Lanes, ego: int, lane: int) -> bool:
    """Whether an ego's box leaves a vehicle that follows a lane no room to drive past.

    Measured, as an ego may lie on more lanes of a junction than are noted of it.
    """
    s, aside_m = project_to_lane(lanes, lane, state.x[ego], state.y[ego])
    turn = state.yaw[ego] - pose_at(lanes, lane, s)[3]
    reach_m = state.half_length[ego] * abs(math.sin(turn))
    reach_m += state.half_width[ego] * abs(math.cos(turn))
    return abs(aside_m) < reach_m + PASSING_M


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
    approach, front = lane_before_junction(lanes, approach, front)
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
def room_before_ego(state: State, lanes: Lanes, egos: int, actor: int) -> float:
    """From a vehicle's front to the first place ahead in its junctions that an ego is in [m].

    Who stops there leaves the ego its way; who stopped at its side would stand in it. In junctions
    that the vehicle has not come to yet, an ego that still drives up to the place comes first too.
    Only places before which the vehicle can still stop count; NO_LEADER_M without one.
    """
    nearest = NO_LEADER_M
    for ego in range(egos):
        for j in range(OCCUPIED_LANES):
            other = state.occupied[ego, j]
            if other < 0:
                break
            if lanes.junction[other] < 0:
                continue
            if not _meets(state, lanes, actor, other):
                continue
            s, _ = project_to_lane(lanes, other, state.x[ego], state.y[ego])
            rear, front = s - state.half_length[ego], s + state.half_length[ego]
            begin = -state.lane_m[actor] - state.half_length[actor]
            for step in range(state.grant_steps[actor] + 1):
                lane = state.path[actor, step]
                stays = state.still_ticks[ego] > EGO_TURN_TICKS
                if stays and not _lies_on(state, lanes, ego, lane):
                    begin += lanes.length_m[lane]
                    continue
                for k in range(lanes.conflict_start[lane], lanes.conflict_start[lane + 1]):
                    room = begin + lanes.conflict_begin_m[k]
                    if (
                        lanes.conflict_lane[k] == other
                        and room < nearest
                        and rear < lanes.conflict_other_end_m[k]
                        and (front > lanes.conflict_other_begin_m[k] or (step > 0 and not stays))
                        and can_stop(state.speed[actor], room, 0.0)
                        and not _same_approach(lanes, lane, other)
                    ):
                        nearest = room
                begin += lanes.length_m[lane]
    return nearest


@kernel
def _meets(state: State, lanes: Lanes, actor: int, other: int) -> bool:
    """Whether a junction lane meets one of the lanes that a vehicle has a grant for, or is on."""
    for step in range(state.grant_steps[actor] + 1):
        lane = state.path[actor, step]
        if lanes.junction[lane] == lanes.junction[other]:  # lanes of two junctions never meet
            for k in range(lanes.conflict_start[lane], lanes.conflict_start[lane + 1]):
                if lanes.conflict_lane[k] == other:
                    return True
    return False


@kernel
def exit_has_room(occupancy: Occupancy, state: State, lanes: Lanes, actor: int, last: int) -> bool:
    """Whether the vehicle would fit behind the last body beyond the junctions.

    Args:
        last: Place in its path of the last junction lane to be granted.
    """
    beyond = last + 1
    if beyond >= PATH_LANES or state.path[actor, beyond] < 0:
        return True
    need = 2.0 * state.half_length[actor] + EXIT_MARGIN_M
    need += _room_of_others(occupancy, state, lanes, actor, state.path[actor, beyond])
    offset = 0.0
    for step in range(beyond, PATH_LANES):
        lane = state.path[actor, step]
        if lane < 0 or offset >= need:
            return True
        body = occupancy.first[lane]
        while body >= 0 and occupancy.actor[body] == actor:
            body = occupancy.next[body]
        if body >= 0:
            speed = occupancy.speed[body]
            room = offset + occupancy.rear_m[body] + speed * speed / 8.0
            return room >= need
        offset += lanes.length_m[lane]
    return True


@kernel
def _room_of_others(
    occupancy: Occupancy, state: State, lanes: Lanes, actor: int, exit_lane: int
) -> float:
    """Metres of an exit that those need who have a grant to it and are still on the way."""
    need = 0.0
    for k in range(lanes.predecessor_start[exit_lane], lanes.predecessor_start[exit_lane + 1]):
        lane = lanes.predecessor[k]
        row = occupancy.claim[lane]
        while row >= 0:
            other = occupancy.claimant[row]
            half = state.half_length[other]
            if other != actor and occupancy.claim_rear_m[row] + half < lanes.length_m[lane]:
                need += 2.0 * half + EXIT_MARGIN_M
            row = occupancy.next_claim[row]
    return need


@kernel
def somebody_waits_between(
    occupancy: Occupancy,
    state: State,
    lanes: Lanes,
    egos: int,
    actor: int,
    first: int,
    last: int,
) -> bool:
    """Whether somebody is, or will come, between junctions that belong together, and stop there.

    Who is short enough may wait where the vehicle itself could not; who is behind it, on the lane
    on which it stands, waits for it.
    """
    for step in range(first, last):
        lane = state.path[actor, step]
        body = occupancy.first[lane]
        while body >= 0:
            other = occupancy.actor[body]
            if other < egos:
                if lanes.junction[lane] < 0:
                    return True
            elif step == 0 and occupancy.rear_m[body] < state.lane_m[actor]:
                pass
            elif other != actor and state.lane[other] == lane:
                if _will_wait_on(state, lanes, other, actor, first, last):
                    return True
            body = occupancy.next[body]
    return False


@kernel
def _will_wait_on(
    state: State, lanes: Lanes, other: int, actor: int, first: int, last: int
) -> bool:
    """Whether the lane up to which another vehicle may drive is one of these of the path."""
    step, _ = find_entry(state, lanes, other, state.grant_steps[other] + 1, NO_LEADER_M)
    if step > 0:
        for k in range(first, last):
            if state.path[actor, k] == state.path[other, step - 1]:
                return True
    return False
