# mypy: disallow_untyped_defs=False
"""Who may enter a junction: a vehicle goes in only with a grant for its way through.

A grant is given when the light is green or the stop has been made, when nobody who holds a grant
for a crossing way, and no ego, is in the way, and when the exit has room, so that nobody ever
stands in a junction and no gridlock forms. Those who have priority are served first, then those
who arrived first; a vehicle that waits its turn keeps later ones from overtaking it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.bundles import by_reference
from di_envs.kernels import kernel
from di_envs.town.lanes import LightState, SignalKind, Turn
from di_envs.town.queries import project_to_lane
from di_envs.world.lights import GREEN_TICKS, YELLOW_TICKS
from di_envs.world.state import OCCUPIED_LANES, PATH_LANES, TICK_S, ActorKind

REQUEST_BRAKING_MPS2 = 2.0  # a grant is asked for while one could still brake this gently
YELLOW_BRAKING_MPS2 = 4.0  # harder than this nobody brakes for a yellow light …
RED_BRAKING_MPS2 = 5.5  # … unless it would be red by the time that they come to the line
SLOWING_MPS2 = 2.0  # with which they may slow down on the way to it, for a bend
STOP_ZONE_M = 4.0  # a stop counts with the front this close to the line
PATIENCE_TICKS = round(30.0 / TICK_S)  # after which a vehicle at a sign is let in by the others
EGO_TURN_TICKS = round(6.0 / TICK_S)  # for which others let an ego that came first go first
EXIT_MARGIN_M = 3.0
MOVING_MPS = 0.5

_ABSENT = int(ActorKind.ABSENT)
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
def find_approach(requests, state, lanes, actor, look_m):
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
def must_stop(state, lanes, signals, actor, approach, distance_m):
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
def _priority(state, lanes, signals, approach, way, waited_ticks):
    """0 goes before 1 (turns left across others) before 2 (has a sign); patience ends."""
    line = lanes.stop_line[approach]
    if line >= 0 and signals.kind[signals.stop_signal[line]] != _LIGHT:
        return 0 if waited_ticks > PATIENCE_TICKS else 2
    return 1 if lanes.turn[way] == _LEFT else 0


@kernel
def _rear_on(state, lanes, actor, lane):
    """Station of a vehicle's rear on a junction lane of its path: negative before it."""
    s = state.lane_m[actor] - state.half_length[actor]
    if state.lane[actor] == lane:
        return s
    if state.previous_lane[actor] == lane:
        return lanes.length_m[lane] + s
    return -1.0


@kernel
def _crosses_holder(occupancy, state, lanes, way, actor):
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
    return False


@kernel
def _same_approach(lanes, a, b):
    """Whether two junction lanes begin at the same approach lane: followers see each other."""
    for i in range(lanes.predecessor_start[a], lanes.predecessor_start[a + 1]):
        for j in range(lanes.predecessor_start[b], lanes.predecessor_start[b + 1]):
            if lanes.predecessor[i] == lanes.predecessor[j]:
                return True
    return False


@kernel
def ways_conflict(lanes, way, other):
    """Whether two junction lanes meet (or are the same)."""
    if way == other:
        return True
    for k in range(lanes.conflict_start[way], lanes.conflict_start[way + 1]):
        if lanes.conflict_lane[k] == other:
            return True
    return False


@kernel
def _ego_in_the_way(state, lanes, signals, egos, way, actor, ranks_after_priority):
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
def _ego_meets(state, lanes, way, lane, ego):
    if lane == way:
        return False  # it is ahead on the same way: a leader, not a crossing
    for k in range(lanes.conflict_start[way], lanes.conflict_start[way + 1]):
        if lanes.conflict_lane[k] == lane:
            s, _ = project_to_lane(lanes, lane, state.x[ego], state.y[ego])
            if s - state.half_length[ego] < lanes.conflict_other_end_m[k]:
                return True
    return False


@kernel
def _ego_comes_first(state, lanes, signals, way, approach, ego, actor, ranks_after_priority):
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
def _exit_has_room(occupancy, state, lanes, actor, way_step):
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


@kernel
def _blocked_by_queue(requests, lanes, way, waiting):
    """Whether somebody whose turn comes earlier waits for a way that meets this one."""
    blocked = False
    for i in range(waiting):
        blocked = blocked or ways_conflict(lanes, way, requests.way[requests.queue[i]])
    return blocked


@kernel
def give_grants(requests, occupancy, state, lanes, signals, egos, asking):
    """Serves those who ask (`requests.queue[:asking]` with ranks) in order of rank.

    Those who could not go for others' sake are moved to the front of the queue scratch: they keep
    later ones from taking their turn.
    """
    _sort_queue(requests, asking)
    waiting = 0
    for i in range(asking):
        actor = requests.queue[i]
        way = requests.way[actor]
        if not _exit_has_room(occupancy, state, lanes, actor, requests.way_step[actor]):
            requests.full[actor] = 1
            continue
        after = requests.rank[actor] >= (np.int64(1) << 40)
        if (
            _blocked_by_queue(requests, lanes, way, waiting)
            or _crosses_holder(occupancy, state, lanes, way, actor)
            or _ego_in_the_way(state, lanes, signals, egos, way, actor, after)
        ):
            requests.queue[waiting] = actor
            waiting += 1
            continue
        state.grant[actor] = way
        occupancy.next_holder[actor] = occupancy.holder[way]
        occupancy.holder[way] = actor


@kernel
def _sort_queue(requests, asking):
    for i in range(1, asking):
        actor = requests.queue[i]
        j = i - 1
        while j >= 0 and requests.rank[requests.queue[j]] > requests.rank[actor]:
            requests.queue[j + 1] = requests.queue[j]
            j -= 1
        requests.queue[j + 1] = actor


@kernel
def update_grants(requests, occupancy, state, lanes, signals, egos, vehicle_end, ahead):
    """One tick of right of way: arrivals, stops, grants taken back at yellow, grants given.

    Args:
        ahead: The vehicles' leaders of this tick (`traffic.Leaders`).
    """
    tick = state.tick[()]
    requests.full[:] = 0
    asking = 0
    for actor in range(egos, vehicle_end):
        if state.kind[actor] == _ABSENT:
            continue
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
        _note_stop(state, lanes, signals, actor, approach, distance, tick)
        if must_stop(state, lanes, signals, actor, approach, distance):
            left_s = _yellow_left_s(state, lanes, signals, approach)
            if state.grant[actor] == way and _can_stop(speed, distance, left_s):
                state.grant[actor] = -1
            continue
        # who has just given up a grant asks from the next tick on: it is still in a holders' list
        if held >= 0 or _waits_behind(state, ahead, actor, distance):
            continue
        waited = tick - state.arrival_tick[actor] if state.arrival_tick[actor] >= 0 else 0
        priority = _priority(state, lanes, signals, approach, way, waited)
        arrival = state.arrival_tick[actor] if state.arrival_tick[actor] >= 0 else tick
        requests.rank[actor] = (np.int64(priority) << 40) + np.int64(arrival)
        requests.queue[asking] = actor
        asking += 1
    give_grants(requests, occupancy, state, lanes, signals, egos, asking)


@kernel
def _yellow_left_s(state, lanes, signals, approach):
    """Seconds until the light at the end of an approach lane is red; 0 once it is, and at signs."""
    signal = signals.stop_signal[lanes.stop_line[approach]]
    if state.light[signal] != _YELLOW:
        return 0.0
    ticks = state.phase_ticks[signals.junction[signal]]
    return (GREEN_TICKS + YELLOW_TICKS - ticks) * TICK_S


@kernel
def _can_stop(speed, distance, yellow_left_s):
    """Whether a vehicle can still stop before its line, hard if it would come there at red."""
    if speed < 1.0:
        return distance > 0.1 * speed
    reach = (speed - 0.5 * SLOWING_MPS2 * yellow_left_s) * yellow_left_s
    braking = YELLOW_BRAKING_MPS2 if distance < reach else RED_BRAKING_MPS2
    return distance > speed * speed / (2.0 * braking) + 0.5


@kernel
def _waits_behind(state, ahead, actor, distance):
    """Whether somebody without a grant stands between a vehicle and its stop line."""
    leader = ahead.actor[actor]
    return leader >= 0 and ahead.gap_m[actor] < distance and state.grant[leader] < 0


@kernel
def _note_stop(state, lanes, signals, actor, approach, distance, tick):
    """Remembers when a vehicle came to the line, and that it stopped there."""
    if distance < 15.0 and state.arrival_tick[actor] < 0:
        state.arrival_tick[actor] = tick
    if state.speed[actor] < 0.1 and distance < STOP_ZONE_M:
        state.stopped_at[actor] = lanes.stop_line[approach]


@kernel
def _release_grant(state, lanes, actor):
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
def note_ego_arrival(state, lanes, ego):
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
