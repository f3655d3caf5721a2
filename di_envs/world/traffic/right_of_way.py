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
from di_envs.town.lanes import Lanes, Signals
from di_envs.world.state import ActorKind, State
from di_envs.world.traffic.approach import (
    MOVING_MPS,
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
from di_envs.world.traffic.granting import GIVE_BACK_TICKS, give_grants
from di_envs.world.traffic.occupancy import Occupancy
from di_envs.world.traffic.speed_choice import Leaders
from di_envs.world.traffic.yielding import room_before_ego

REQUEST_BRAKING_MPS2 = 2.0  # a grant is asked for while one could still brake this gently
WAITING_M = 30.0  # before a junction, where one counts as waiting for it
OVER_LINE_M = 1.0  # as far as somebody may stand beyond the line at which he waits
INSIDE = -1  # priority of who is in a junction, before all who come to it
NEAR_M = 8.0  # who stands this close behind somebody stands because of him

_ABSENT = int(ActorKind.ABSENT)


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
