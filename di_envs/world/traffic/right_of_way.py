"""Who may enter a junction: a vehicle goes in only with a grant for its way through.

A grant is given when the light is green or the stop has been made, when nobody who holds a grant
for a crossing way, and no ego, is in the way, and when the exit has room, so that nobody ever
stands in a junction and no gridlock forms. Those who have priority are served first, then those
who arrived first; a vehicle that waits its turn keeps later ones from overtaking it.
"""

from __future__ import annotations

from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, Signals
from di_envs.world.state import PATH_LANES, ActorKind, State
from di_envs.world.traffic.approach import (
    Requests,
    can_stop,
    find_approach,
    must_stop,
    note_stop,
    priority_of,
    yellow_left_s,
)
from di_envs.world.traffic.occupancy import Occupancy
from di_envs.world.traffic.speed_choice import Leaders
from di_envs.world.traffic.yielding import (
    crosses_holder,
    ego_in_the_way,
    exit_has_room,
    ways_conflict,
)

REQUEST_BRAKING_MPS2 = 2.0  # a grant is asked for while one could still brake this gently
STANDING_ROOM_M = 2.0  # between two junctions, beyond a vehicle's length, for it to wait there

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
    requests.full[:] = 0
    asking = 0
    for actor in range(egos, vehicle_end):
        if state.kind[actor] == _ABSENT:
            continue
        _make_way_for_next(state, lanes, actor)
        held = state.grant[actor]
        _release_grant(state, lanes, actor)
        speed = state.speed[actor]
        reach = 10.0 + 1.5 * speed + speed * speed / (2.0 * REQUEST_BRAKING_MPS2)
        find_approach(requests, state, lanes, actor, reach)
        way = requests.way[actor]
        if way < 0:
            state.arrival_tick[actor] = -1
            continue
        distance = requests.distance_m[actor]
        approach = state.path[actor, requests.way_step[actor] - 1]
        note_stop(state, lanes, signals, actor, approach, distance, tick)
        if must_stop(state, lanes, signals, actor, approach):
            left_s = yellow_left_s(state, lanes, signals, approach)
            if state.grant[actor] == way and can_stop(speed, distance, left_s):
                state.grant[actor] = -1
            continue
        # who has just given up a grant asks from the next tick on: it is still in a holders' list
        if held >= 0 or _waits_behind(state, ahead, actor, distance):
            continue
        waited = tick - state.arrival_tick[actor] if state.arrival_tick[actor] >= 0 else 0
        priority = priority_of(state, lanes, signals, approach, way, waited)
        arrival = state.arrival_tick[actor] if state.arrival_tick[actor] >= 0 else tick
        requests.rank[actor] = (as_int64(priority) << 40) + as_int64(arrival)
        requests.queue[asking] = actor
        asking += 1
    give_grants(requests, occupancy, state, lanes, signals, egos, asking)


@kernel
def _waits_behind(state: State, ahead: Leaders, actor: int, distance: float) -> bool:
    """Whether somebody without a grant stands between a vehicle and its stop line."""
    leader = ahead.actor[actor]
    return leader >= 0 and ahead.gap_m[actor] < distance and state.grant[leader] < 0


@kernel
def _make_way_for_next(state: State, lanes: Lanes, actor: int) -> None:
    """On its way through a junction that the next one follows closely, a vehicle asks for that too.

    It cannot wait until its rear has left the first: there is no room for it in between.
    """
    grant = state.grant[actor]
    link, beyond = state.path[actor, 1], state.path[actor, 2]
    if grant < 0 or state.lane[actor] != grant or link < 0 or beyond < 0:
        return
    if lanes.junction[link] >= 0 or lanes.junction[beyond] < 0 or state.leaving[actor] >= 0:
        return
    if lanes.length_m[link] < 2.0 * state.half_length[actor] + STANDING_ROOM_M:
        state.leaving[actor] = grant
        state.leaving_m[actor] = state.lane_m[actor] - lanes.length_m[grant]
        state.grant[actor] = -1
        state.stopped_at[actor] = -1
        state.arrival_tick[actor] = -1


@kernel
def _release_grant(state: State, lanes: Lanes, actor: int) -> None:
    """A grant ends when the vehicle's rear has left the junction."""
    grant = state.grant[actor]
    if grant < 0:
        return
    lane = state.lane[actor]
    if lane == grant or lanes.junction[lane] == lanes.junction[grant]:
        return
    for step in range(1, PATH_LANES):
        ahead = state.path[actor, step]
        if ahead < 0 or lanes.junction[ahead] >= 0:
            if ahead == grant:
                return  # still ahead (a path may come back to a junction: only the next counts)
            break
    if state.lane_m[actor] >= state.half_length[actor]:
        state.grant[actor] = -1
        state.stopped_at[actor] = -1
        state.arrival_tick[actor] = -1


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

    Those who could not go for others' sake are moved to the front of the queue scratch: they keep
    later ones from taking their turn.
    """
    _sort_queue(requests, asking)
    waiting = 0
    for i in range(asking):
        actor = requests.queue[i]
        way = requests.way[actor]
        if not exit_has_room(occupancy, state, lanes, actor, requests.way_step[actor]):
            requests.full[actor] = 1
            continue
        after = requests.rank[actor] >= (as_int64(1) << 40)
        if (
            _blocked_by_queue(requests, lanes, way, waiting)
            or crosses_holder(occupancy, state, lanes, way, actor)
            or ego_in_the_way(state, lanes, signals, egos, way, actor, after)
        ):
            requests.queue[waiting] = actor
            waiting += 1
            continue
        state.grant[actor] = way
        occupancy.next_holder[actor] = occupancy.holder[way]
        occupancy.holder[way] = actor


@kernel
def _blocked_by_queue(requests: Requests, lanes: Lanes, way: int, waiting: int) -> bool:
    """Whether somebody whose turn comes earlier waits for a way that meets this one."""
    blocked = False
    for i in range(waiting):
        blocked = blocked or ways_conflict(lanes, way, requests.way[requests.queue[i]])
    return blocked


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
