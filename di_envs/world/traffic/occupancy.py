"""Who is where on the lanes: per tick, each lane's bodies in order, and the search for a leader.

A body lies on every lane that it overlaps: its own, those that its tail has not left, the one a
lane change leaves, and for a free body (an ego) each lane below its box. Lanes inside junctions
have claims besides: of those who are on them, and of those who have the grant to come.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.arrays import Int32
from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes
from di_envs.town.queries import project_to_lane
from di_envs.world.state import OCCUPIED_LANES, PATH_LANES, TAIL_LANES, ActorKind, State
from di_envs.world.traffic.approach import lane_behind
from di_envs.world.traffic.car_following import NO_LEADER_M
from di_envs.world.traffic.tables import TrafficTables

ACROSS_COS = math.cos(math.radians(60.0))  # of the angle from which on one lies across a lane

_ABSENT, _WALKER = int(ActorKind.ABSENT), int(ActorKind.WALKER)


@by_reference
class Occupancy(NamedTuple):
    """Scratch of one tick: bodies as linked lists by lane, ordered by their rear stations."""

    first: NDArray[np.int32]  # (L,) first body of a lane, -1 for none
    next: NDArray[np.int32]  # (N,) the body ahead of it on the lane, -1 for none
    actor: NDArray[np.int32]  # (N,)
    rear_m: NDArray[np.float64]  # (N,) lane stations
    front_m: NDArray[np.float64]  # (N,)
    speed: NDArray[np.float64]  # (N,) along the lane, not negative
    across: NDArray[np.int8]  # (N,) 1 for a free body that lies across the lane
    size: NDArray[np.int32]  # (1,) bodies in use
    claim: NDArray[np.int32]  # (L,) first claim to a junction lane, or -1
    next_claim: NDArray[np.int32]  # (M,) the next one to the same lane, or -1
    claimant: NDArray[np.int32]  # (M,) the vehicle
    claim_rear_m: NDArray[np.float64]  # (M,) station of its rear, negative before the lane
    claim_front_m: NDArray[np.float64]  # (M,) how far it may go, NO_LEADER_M for all the way
    claims: NDArray[np.int32]  # (1,) claims in use


def make_occupancy(lanes: int, actors: int, egos: int) -> Occupancy:
    """Allocates the scratch for `lanes` lanes and `actors` actors, `egos` of them free bodies."""
    bodies = (TAIL_LANES + 4) * actors + OCCUPIED_LANES * egos
    claims = (TAIL_LANES + 2 * PATH_LANES + 1) * actors
    return Occupancy(
        first=np.full(lanes, -1, np.int32),
        next=np.full(bodies, -1, np.int32),
        actor=np.full(bodies, -1, np.int32),
        rear_m=np.zeros(bodies),
        front_m=np.zeros(bodies),
        speed=np.zeros(bodies),
        across=np.zeros(bodies, np.int8),
        size=np.zeros(1, np.int32),
        claim=np.full(lanes, -1, np.int32),
        next_claim=np.full(claims, -1, np.int32),
        claimant=np.full(claims, -1, np.int32),
        claim_rear_m=np.zeros(claims),
        claim_front_m=np.zeros(claims),
        claims=np.zeros(1, np.int32),
    )


@kernel
def insert_body(
    occupancy: Occupancy, lane: int, actor: int, rear_m: float, front_m: float, speed: float
) -> None:
    """Adds a body, between two stations of a lane, to the lane's list, in order."""
    body = occupancy.size[0]
    occupancy.size[0] = body + 1
    occupancy.actor[body] = actor
    occupancy.rear_m[body] = rear_m
    occupancy.front_m[body] = front_m
    occupancy.speed[body] = speed
    occupancy.across[body] = 0
    behind = -1
    ahead = occupancy.first[lane]
    while ahead >= 0 and occupancy.rear_m[ahead] < rear_m:
        behind = ahead
        ahead = occupancy.next[ahead]
    occupancy.next[body] = ahead
    if behind < 0:
        occupancy.first[lane] = body
    else:
        occupancy.next[behind] = body


@kernel
def fill_occupancy(
    occupancy: Occupancy, state: State, lanes: Lanes, egos: int, vehicle_end: int
) -> None:
    """Rebuilds all lists from the state: egos [0, egos), vehicles [egos, vehicle_end)."""
    occupancy.first[:] = -1
    occupancy.claim[:] = -1
    occupancy.size[0] = occupancy.claims[0] = 0
    for ego in range(egos):
        _insert_free_body(occupancy, state, lanes, ego)
    for actor in range(egos, vehicle_end):
        if state.kind[actor] != _ABSENT and state.lane[actor] >= 0:
            insert_vehicle(occupancy, state, lanes, actor)
            if state.grant_steps[actor] > 0:
                claim_ahead(occupancy, state, lanes, actor, 1, state.grant_steps[actor])


@kernel
def insert_vehicle(occupancy: Occupancy, state: State, lanes: Lanes, actor: int) -> None:
    """Adds a vehicle on its own lane, behind it and beside it, as far as its body reaches."""
    lane = state.lane[actor]
    s, half, speed = state.lane_m[actor], state.half_length[actor], state.speed[actor]
    insert_body(occupancy, lane, actor, s - half, s + half, speed)
    if lanes.junction[lane] >= 0:
        reach = NO_LEADER_M if state.grant[actor] >= 0 else s + half
        _add_claim(occupancy, lane, actor, s - half, reach)
    beside = state.changing_from[actor]
    if beside >= 0:
        along = s * lanes.length_m[beside] / lanes.length_m[lane]
        insert_body(occupancy, beside, actor, along - half, along + half, speed)
    for step in range(TAIL_LANES + 1):
        before = lane_behind(state, actor, step)
        if before < 0 or s >= half:
            break
        s += lanes.length_m[before]
        insert_body(occupancy, before, actor, s - half, s + half, speed)
        if lanes.junction[before] >= 0:
            _add_claim(occupancy, before, actor, s - half, NO_LEADER_M)


@kernel
def claim_ahead(
    occupancy: Occupancy, state: State, lanes: Lanes, actor: int, first: int, last: int
) -> None:
    """Claims the junction lanes of a vehicle's path from place `first` to `last`."""
    begin = -state.lane_m[actor]
    for step in range(last + 1):
        lane = state.path[actor, step]
        if step >= first and lanes.junction[lane] >= 0:
            rear = -begin - state.half_length[actor]
            _add_claim(occupancy, lane, actor, rear, NO_LEADER_M)
        begin += lanes.length_m[lane]


@kernel
def _add_claim(occupancy: Occupancy, lane: int, actor: int, rear_m: float, front_m: float) -> None:
    """Adds a claim to a lane's list."""
    row = occupancy.claims[0]
    occupancy.claims[0] = row + 1
    occupancy.claimant[row] = actor
    occupancy.claim_rear_m[row] = rear_m
    occupancy.claim_front_m[row] = front_m
    occupancy.next_claim[row] = occupancy.claim[lane]
    occupancy.claim[lane] = row


@kernel
def _insert_free_body(occupancy: Occupancy, state: State, lanes: Lanes, actor: int) -> None:
    """Adds an ego on each driving lane below its box, as long as it is along that lane."""
    half_length, half_width = state.half_length[actor], state.half_width[actor]
    for k in range(OCCUPIED_LANES):
        lane = state.occupied[actor, k]
        if lane < 0:
            break
        s, _ = project_to_lane(lanes, lane, state.x[actor], state.y[actor])
        point = lanes.first[lane] + min(
            max(int(s / lanes.spacing_m[lane]), 0), lanes.count[lane] - 1
        )
        angle = state.yaw[actor] - lanes.points[point, 3]
        along = abs(math.cos(angle)) * half_length + abs(math.sin(angle)) * half_width
        speed = max(state.speed[actor] * math.cos(angle), 0.0)
        insert_body(occupancy, lane, actor, s - along, s + along, speed)
        if math.cos(angle) < ACROSS_COS:
            occupancy.across[occupancy.size[0] - 1] = 1


@kernel
def body_ahead(occupancy: Occupancy, lane: int, actor: int, s: float) -> int:
    """The first body on a lane, not the actor's own, with its middle ahead of station s; or -1."""
    body = occupancy.first[lane]
    while body >= 0:
        if occupancy.actor[body] != actor:
            middle = 0.5 * (occupancy.rear_m[body] + occupancy.front_m[body])
            if middle > s or (middle == s and occupancy.actor[body] > actor):
                return body
        body = occupancy.next[body]
    return -1


@kernel
def body_behind(occupancy: Occupancy, lane: int, actor: int, s: float) -> int:
    """The last body on a lane, not the actor's own, whose middle lies behind station s; or -1."""
    found = -1
    body = occupancy.first[lane]
    while body >= 0:
        if occupancy.actor[body] != actor:
            if 0.5 * (occupancy.rear_m[body] + occupancy.front_m[body]) <= s:
                found = body
        body = occupancy.next[body]
    return found


@kernel
def _nearest_sibling(
    occupancy: Occupancy, tables: TrafficTables, lane: int, actor: int, s: float, best_rear: float
) -> int:
    """A body on a junction lane that forks from the same approach lane, where both overlap.

    Who lies across that lane has not come by it: he counts only where he is on the own lane.
    """
    found = -1
    for k in range(tables.sibling_start[lane], tables.sibling_start[lane + 1]):
        body = occupancy.first[tables.sibling_lane[k]]
        while body >= 0:
            rear = occupancy.rear_m[body]
            middle = 0.5 * (rear + occupancy.front_m[body])
            if (
                occupancy.actor[body] != actor
                and middle > s
                and rear < tables.sibling_end_m[k]
                and rear < best_rear
                and occupancy.across[body] == 0
            ):
                best_rear = rear
                found = body
            body = occupancy.next[body]
    return found


@kernel
def find_leader(
    occupancy: Occupancy,
    lanes: Lanes,
    tables: TrafficTables,
    path: Int32,
    actor: int,
    s: float,
    front: float,
    look_m: float,
) -> tuple[float, float, int]:
    """The first body ahead along a path of lanes.

    Args:
        path: (PATH_LANES,) lanes, the first one being where station `s` lies.
        s: Station of the actor's middle on the first lane [m].
        front: Station of its front [m].
        look_m: How far ahead of the front to look.

    Returns:
        (gap to its rear [m], its speed along the lane [m/s], its actor id), or
        (NO_LEADER_M, 0, -1).
    """
    offset = -front
    for step in range(PATH_LANES):
        lane = path[step]
        if lane < 0 or offset > look_m:
            break
        here = s if step == 0 else -NO_LEADER_M
        body = body_ahead(occupancy, lane, actor, here)
        if tables.sibling_start[lane] != tables.sibling_start[lane + 1]:
            rear = occupancy.rear_m[body] if body >= 0 else NO_LEADER_M
            sibling = _nearest_sibling(occupancy, tables, lane, actor, here, rear)
            if sibling >= 0:
                body = sibling
        if body >= 0:
            gap = offset + occupancy.rear_m[body]
            if gap > look_m:
                break
            return gap, occupancy.speed[body], occupancy.actor[body]
        offset += lanes.length_m[lane]
    return NO_LEADER_M, 0.0, -1
