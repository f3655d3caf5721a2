"""Who of those who ask for a way through a junction gets a grant, and who waits for whom.

Those who have priority are served first, then those who arrived first, then those with the lower
id. Nobody gets a grant whose exit has no room, or on whose way somebody is who has a claim to a
crossing one; a vehicle that waits its turn keeps later ones from overtaking it.
"""

from __future__ import annotations

from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, SignalKind, Signals
from di_envs.world.state import PATH_LANES, TICK_S, State
from di_envs.world.traffic.approach import PATIENCE_TICKS, Requests, must_stop
from di_envs.world.traffic.car_following import NO_LEADER_M
from di_envs.world.traffic.occupancy import Occupancy, claim_ahead
from di_envs.world.traffic.yielding import (
    crossing_claimant,
    ego_in_the_way,
    exit_has_room,
    room_before_ego,
    somebody_waits_between,
    ways_conflict,
)

GIVE_BACK_TICKS = round(5.0 / TICK_S)  # of standing still with a grant, then others have a turn

_EXIT, _AHEAD = 1, 2  # what shuts a way: no room behind it, or somebody on it
_LIGHT = int(SignalKind.LIGHT)


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
