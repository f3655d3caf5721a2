"""Who may enter a junction: a vehicle goes in only with a grant for its way through.

A grant is given when the light is green or the stop has been made, when nobody who has a claim to
a crossing way, and no ego, is in the way, and when the exit has room, so that nobody ever stands
in a junction and no gridlock forms. Where the next junction follows so closely that one could not
wait before it, both are granted at once. Those who have priority are served first, then those who
arrived first, then those with the lower id; a vehicle that waits its turn keeps later ones from
overtaking it. Who cannot use its grant gives it back, so that nobody waits for who waits for him.
"""

from __future__ import annotations

from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, SignalKind, Signals
from di_envs.world.state import PATH_LANES, TICK_S, ActorKind, State
from di_envs.world.traffic.approach import (
    MOVING_MPS,
    PATIENCE_TICKS,
    Requests,
    can_stop,
    find_entry,
    is_over_junction,
    must_stop,
    note_stop,
    priority_of,
    run_end,
    yellow_left_s,
)
from di_envs.world.traffic.car_following import NO_LEADER_M
from di_envs.world.traffic.occupancy import Occupancy, claim_ahead
from di_envs.world.traffic.speed_choice import Leaders
from di_envs.world.traffic.yielding import (
    crossing_claimant,
    ego_in_the_way,
    exit_has_room,
    room_before_ego,
    somebody_waits_between,
    ways_conflict,
)

REQUEST_BRAKING_MPS2 = 2.0  # a grant is asked for while one could still brake this gently
GIVE_BACK_TICKS = round(5.0 / TICK_S)  # of standing still with a grant, then others have a turn
WAITING_M = 30.0  # before a junction, where one counts as waiting for it
OVER_LINE_M = 1.0  # as far as somebody may stand beyond the line at which he waits
INSIDE = -1  # priority of who is in a junction, before all who come to it
NEAR_M = 8.0  # who stands this close behind somebody stands because of him

_EXIT, _AHEAD = 1, 2  # what shuts a way: no room behind it, or somebody on it
_ABSENT = int(ActorKind.ABSENT)
_LIGHT = int(SignalKind.LIGHT)


@kernel
def update_grants(
    requests: Requests,
    occupancy: Occupancy,
    state: State,
    lanes: Lanes,
    signals: Signals,
    egos: int,
    vehicle_end: int,
    ahead: Leaders,
) -> None:
    """One tick of right of way: arrivals, stops, grants taken back at yellow, grants given.

    Args:
        ahead: The vehicles' leaders of this tick.
    """
    tick = int(state.tick[()])
    requests.shut[:] = 0
    asking = 0
    for actor in range(egos, vehicle_end):
        requests.way[actor] = -1
        requests.line_m[actor] = NO_LEADER_M
        if state.kind[actor] == _ABSENT:
            continue
        _move_grant_on(state, lanes, actor)
        asks = False
        if state.grant[actor] < 0 and lanes.junction[state.lane[actor]] >= 0:
            asks = _ask_inside(requests, state, lanes, ahead, egos, actor)
        elif not _give_back_inside(requests, state, lanes, ahead, egos, actor):
            asks = _ask_before(requests, state, lanes, signals, ahead, actor, tick)
        if asks:
            _rank(requests, state, lanes, signals, actor, tick)
            requests.queue[asking] = actor
            asking += 1
    give_grants(requests, occupancy, state, lanes, signals, egos, asking)


@kernel
def _move_grant_on(state: State, lanes: Lanes, actor: int) -> None:
    """A grant goes on to the next junction that it is for, and ends when the rear has left all."""
    grant = state.grant[actor]
    lane = state.lane[actor]
    if grant < 0 or lane == grant:
        return
    if lanes.junction[lane] >= 0:
        if lanes.junction[lane] != lanes.junction[grant]:
            state.grant[actor] = lane
        return
    if state.grant_steps[actor] > 0:
        step, _ = find_entry(state, lanes, actor, 1, NO_LEADER_M)
        if 0 < step <= state.grant_steps[actor]:
            state.grant[actor] = state.path[actor, step]
            return
    if not is_over_junction(state, lanes, actor):
        _give_back(state, actor)


@kernel
def _stands_with_grant(state: State, actor: int) -> bool:
    """Whether a vehicle has had a grant for a while and not moved."""
    since = min(state.still_ticks[actor], state.tick[()] - state.grant_tick[actor])
    return since > GIVE_BACK_TICKS


@kernel
def _give_back(state: State, actor: int) -> None:
    state.grant[actor] = -1
    state.grant_steps[actor] = 0


@kernel
def _give_back_inside(
    requests: Requests, state: State, lanes: Lanes, ahead: Leaders, egos: int, actor: int
) -> bool:
    """Who stands in a junction behind somebody, or for an ego, gives its grant back.

    Else both would wait for ever if he waits for the way that it holds. Notes too how far a
    vehicle with a grant may go for the sake of egos that are in its way.
    """
    if state.grant[actor] < 0:
        return False
    requests.line_m[actor] = room_before_ego(state, lanes, egos, actor)
    if lanes.junction[state.lane[actor]] < 0 or not _stands_with_grant(state, actor):
        return False
    if requests.line_m[actor] > NEAR_M and not _is_behind_anybody(ahead, egos, actor):
        return False
    _give_back(state, actor)
    return True


@kernel
def _is_behind_anybody(ahead: Leaders, egos: int, actor: int) -> bool:
    """Whether an ego, or a vehicle that stands, is close before a vehicle."""
    leader = ahead.actor[actor]
    if leader < 0 or ahead.gap_m[actor] >= NEAR_M:
        return False
    return leader < egos or ahead.speed[actor] < MOVING_MPS


@kernel
def _ask_inside(
    requests: Requests, state: State, lanes: Lanes, ahead: Leaders, egos: int, actor: int
) -> bool:
    """Notes what a vehicle needs that stands in a junction without a grant; whether it asks."""
    requests.line_m[actor] = 0.0
    requests.way[actor] = state.lane[actor]
    requests.way_step[actor] = 0
    requests.way_end[actor] = run_end(state, lanes, actor, 0)
    if state.arrival_tick[actor] < 0:
        state.arrival_tick[actor] = state.tick[()]
    return not _is_behind_anybody(ahead, egos, actor)


@kernel
def _ask_before(
    requests: Requests,
    state: State,
    lanes: Lanes,
    signals: Signals,
    ahead: Leaders,
    actor: int,
    tick: int,
) -> bool:
    """Notes what a vehicle meets at the next junction on its path; whether it asks to enter."""
    speed = state.speed[actor]
    reach = 10.0 + 1.5 * speed + speed * speed / (2.0 * REQUEST_BRAKING_MPS2)
    step, distance = find_entry(state, lanes, actor, 1, reach)
    if step < 0:
        state.arrival_tick[actor] = -1
        return False
    approach = state.path[actor, step - 1]
    note_stop(state, lanes, signals, actor, approach, distance, tick)
    requests.way_step[actor] = step
    if step <= state.grant_steps[actor]:
        requests.way_end[actor] = run_end(state, lanes, actor, step)
        _keep_or_give_back(requests, state, lanes, signals, ahead, actor, step, distance)
        return False
    requests.line_m[actor] = min(distance, requests.line_m[actor])
    requests.way[actor] = state.path[actor, step]
    if must_stop(state, lanes, signals, actor, approach):
        return False
    requests.way_end[actor] = run_end(state, lanes, actor, step)
    return not _waits_behind(requests, state, lanes, ahead, actor, distance)


@kernel
def _keep_or_give_back(
    requests: Requests,
    state: State,
    lanes: Lanes,
    signals: Signals,
    ahead: Leaders,
    actor: int,
    step: int,
    distance: float,
) -> None:
    """A grant for the junction ahead is taken back at yellow, and where it cannot be used.

    Who is already on its way through a junction that belongs to this one keeps that one's alone.
    """
    speed = state.speed[actor]
    inside = is_over_junction(state, lanes, actor)
    approach = state.path[actor, step - 1]
    if must_stop(state, lanes, signals, actor, approach):
        if can_stop(speed, distance, yellow_left_s(state, lanes, signals, approach)):
            requests.line_m[actor] = min(distance, requests.line_m[actor])
            if not inside:
                _give_back(state, actor)
            elif state.stopped_at[actor] != lanes.stop_line[approach]:
                state.grant_steps[actor] = step - 1
        return
    if _stands_with_grant(state, actor) or _waits_behind(
        requests, state, lanes, ahead, actor, distance
    ):
        if not can_stop(speed, distance, 0.0):
            return
        if not inside:
            requests.line_m[actor] = distance
            _give_back(state, actor)
            state.arrival_tick[actor] = state.tick[()]
        elif _stands_with_grant(state, actor) and ahead.gap_m[actor] < NEAR_M:
            requests.line_m[actor] = min(distance, requests.line_m[actor])
            state.grant_steps[actor] = step - 1


@kernel
def _rank(
    requests: Requests, state: State, lanes: Lanes, signals: Signals, actor: int, tick: int
) -> None:
    """The turn of one who asks: by priority, then by arrival; who is in a junction comes first."""
    arrival = state.arrival_tick[actor] if state.arrival_tick[actor] >= 0 else tick
    step, priority = requests.way_step[actor], INSIDE
    if not is_over_junction(state, lanes, actor):
        approach, way = state.path[actor, step - 1], requests.way[actor]
        priority = priority_of(state, lanes, signals, approach, way, tick - arrival)
    requests.rank[actor] = (as_int64(priority) << 40) + as_int64(arrival)


@kernel
def _waits_behind(
    requests: Requests, state: State, lanes: Lanes, ahead: Leaders, actor: int, distance: float
) -> bool:
    """Whether somebody without a grant stands between a vehicle and its stop line.

    Anybody does, if more than one junction is to be granted: he may stop between them.
    """
    leader = ahead.actor[actor]
    if leader < 0 or ahead.gap_m[actor] >= distance:
        return False
    if state.grant[leader] < 0 or requests.way_end[actor] > requests.way_step[actor]:
        return True
    length = 2.0 * state.half_length[leader]
    before_line = ahead.gap_m[actor] + length < distance + OVER_LINE_M
    step, _ = find_entry(state, lanes, leader, 1, WAITING_M)
    return before_line and step > state.grant_steps[leader]


@kernel
def give_grants(
    requests: Requests,
    occupancy: Occupancy,
    state: State,
    lanes: Lanes,
    signals: Signals,
    egos: int,
    asking: int,
) -> None:
    """Serves those who ask (`requests.queue[:asking]` with ranks) in order of rank.

    Those who could not go are moved to the front of the queue scratch: they keep later ones from
    taking their turn, or the room for which they wait.
    """
    _sort_queue(requests, asking)
    waiting = 0
    for i in range(asking):
        actor = requests.queue[i]
        first, last = requests.way_step[actor], requests.way_end[actor]
        if somebody_waits_between(occupancy, state, lanes, egos, actor, first, last):
            requests.shut[actor] = _AHEAD
            continue
        if _exit_is_promised(requests, state, actor, waiting) or not exit_has_room(
            occupancy, state, lanes, actor, last
        ):
            requests.shut[actor] = _EXIT
            requests.queue[waiting] = actor
            waiting += 1
            continue
        if not _inner_lights_allow(state, lanes, signals, actor, first, last):
            continue
        if _meets_ego(requests, state, lanes, signals, egos, actor):
            requests.shut[actor] = _AHEAD
            continue
        met = _whom_it_meets(requests, occupancy, state, lanes, actor)
        if met >= 0 and state.still_ticks[met] > GIVE_BACK_TICKS:
            requests.shut[actor] = _AHEAD
            continue
        if met >= 0 or _waits_its_turn(requests, state, lanes, actor, waiting):
            requests.queue[waiting] = actor
            waiting += 1
            continue
        if state.grant[actor] < 0:
            state.grant[actor] = requests.way[actor]
        state.grant_steps[actor] = last
        state.grant_tick[actor] = state.tick[()]
        requests.line_m[actor] = room_before_ego(state, lanes, egos, actor)
        claim_ahead(occupancy, state, lanes, actor, first, last)


@kernel
def _exit_is_promised(requests: Requests, state: State, actor: int, waiting: int) -> bool:
    """Whether somebody whose turn comes earlier waits for room in the same exit."""
    beyond = requests.way_end[actor] + 1
    if beyond >= PATH_LANES or state.path[actor, beyond] < 0:
        return False
    for i in range(waiting):
        other = requests.queue[i]
        theirs = requests.way_end[other] + 1
        if requests.shut[other] == _EXIT and theirs < PATH_LANES:
            if state.path[other, theirs] == state.path[actor, beyond]:
                return True
    return False


@kernel
def _inner_lights_allow(
    state: State, lanes: Lanes, signals: Signals, actor: int, first: int, last: int
) -> bool:
    """Whether no light shows red between junctions that belong together, or one waited long."""
    came = state.arrival_tick[actor]
    if came >= 0 and state.tick[()] - came > PATIENCE_TICKS:
        return True
    for step in range(first, last):
        line = lanes.stop_line[state.path[actor, step]]
        if line >= 0 and signals.kind[signals.stop_signal[line]] == _LIGHT:
            if must_stop(state, lanes, signals, actor, state.path[actor, step]):
                return False
    return True


@kernel
def _meets_ego(
    requests: Requests, state: State, lanes: Lanes, signals: Signals, egos: int, actor: int
) -> bool:
    """Whether an ego is in a vehicle's way: then others may go first, for it may stand for ever."""
    after = requests.rank[actor] >= (as_int64(1) << 40)
    for step in range(requests.way_step[actor], requests.way_end[actor] + 1):
        way = state.path[actor, step]
        if lanes.junction[way] >= 0:
            if ego_in_the_way(state, lanes, signals, egos, way, actor, after):
                return True
    return False


@kernel
def _whom_it_meets(
    requests: Requests, occupancy: Occupancy, state: State, lanes: Lanes, actor: int
) -> int:
    """Who has a claim that crosses a lane for which a vehicle asks, or -1; first who stands.

    Who waits for one that stands keeps nobody from going first: that one may wait for them.
    """
    met = -1
    for step in range(requests.way_step[actor], requests.way_end[actor] + 1):
        way = state.path[actor, step]
        if lanes.junction[way] < 0:
            continue
        passed_m = -NO_LEADER_M
        if step == 0:
            passed_m = state.lane_m[actor] - state.half_length[actor]
        other = crossing_claimant(occupancy, state, lanes, way, actor, passed_m)
        if other >= 0 and (met < 0 or state.still_ticks[other] > state.still_ticks[met]):
            met = other
    return met


@kernel
def _waits_its_turn(
    requests: Requests, state: State, lanes: Lanes, actor: int, waiting: int
) -> bool:
    """Whether others come first on any of the junction lanes that a vehicle asks for.

    Who stands in a junction already waits for nobody's turn, as he whose it is may wait for it.
    """
    if requests.rank[actor] < 0:
        return False
    for step in range(requests.way_step[actor], requests.way_end[actor] + 1):
        way = state.path[actor, step]
        if lanes.junction[way] >= 0 and _blocked_by_queue(requests, state, lanes, way, waiting):
            return True
    return False


@kernel
def _blocked_by_queue(
    requests: Requests, state: State, lanes: Lanes, way: int, waiting: int
) -> bool:
    """Whether somebody whose turn comes earlier waits for a way that meets this one."""
    for i in range(waiting):
        actor = requests.queue[i]
        if requests.shut[actor] == _EXIT:
            continue
        for step in range(requests.way_step[actor], requests.way_end[actor] + 1):
            if ways_conflict(lanes, way, state.path[actor, step]):
                return True
    return False


@kernel
def _sort_queue(requests: Requests, asking: int) -> None:
    """Sorts those who ask by rank, those of one rank as they stand."""
    for i in range(1, asking):
        actor = requests.queue[i]
        j = i - 1
        while j >= 0 and requests.rank[requests.queue[j]] > requests.rank[actor]:
            requests.queue[j + 1] = requests.queue[j]
            j -= 1
        requests.queue[j + 1] = actor
