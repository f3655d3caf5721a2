"""Traffic's decisions: whom a vehicle follows, how fast its road lets it go, where it must stop."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.arrays import Int8
from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes
from di_envs.world.state import PATH_LANES, ActorKind, State
from di_envs.world.traffic.approach import STOP_ZONE_M, Requests
from di_envs.world.traffic.car_following import (
    ACCELERATION_MPS2,
    CAR_LENGTH_M,
    DISTANCE_WANTED_M,
    EMERGENCY_BRAKING_MPS2,
    MAX_BRAKING_MPS2,
    NO_LEADER_M,
    idm_acceleration,
    safe_speed,
)
from di_envs.world.traffic.occupancy import Occupancy, find_leader
from di_envs.world.traffic.tables import SLOWING_MPS2, TrafficTables

LINE_GAP_M = 0.8  # at which vehicles stop before a line
SAFE_GAP_M = 0.4
FAST_MPS = 1e9  # faster than anybody may

_ABSENT = int(ActorKind.ABSENT)


@by_reference
class Leaders(NamedTuple):
    """Scratch of one tick: the body ahead of each vehicle on its path."""

    gap_m: NDArray[np.float64]  # (A,) from front to rear, NO_LEADER_M for none
    speed: NDArray[np.float64]  # (A,)
    actor: NDArray[np.int32]  # (A,) -1 for none


def make_leaders(actors: int) -> Leaders:
    """Allocates the scratch for `actors` actors."""
    return Leaders(
        gap_m=np.full(actors, NO_LEADER_M),
        speed=np.zeros(actors),
        actor=np.full(actors, -1, np.int32),
    )


@kernel
def find_leaders(
    leaders: Leaders,
    occupancy: Occupancy,
    state: State,
    lanes: Lanes,
    tables: TrafficTables,
    egos: int,
    vehicle_end: int,
) -> None:
    """Finds the body ahead of each vehicle, on both lanes while it changes lanes."""
    for actor in range(egos, vehicle_end):
        if state.kind[actor] == _ABSENT:
            continue
        s = state.lane_m[actor]
        speed = state.speed[actor]
        look = 25.0 + 2.0 * speed + speed * speed / 6.0
        gap, leader_speed, leader = find_leader(
            occupancy,
            lanes,
            tables,
            state.path[actor],
            actor,
            s,
            s + state.half_length[actor],
            look,
        )
        leaders.gap_m[actor] = gap
        leaders.speed[actor] = leader_speed
        leaders.actor[actor] = leader
        if state.changing_from[actor] >= 0:
            _leader_on_old_lane(leaders, occupancy, state, lanes, actor)


@kernel
def _leader_on_old_lane(
    leaders: Leaders, occupancy: Occupancy, state: State, lanes: Lanes, actor: int
) -> None:
    """Follows the body ahead on the lane that a change leaves, if it is nearer."""
    lane = state.changing_from[actor]
    s = state.lane_m[actor] * lanes.length_m[lane] / lanes.length_m[state.lane[actor]]
    body = occupancy.first[lane]
    while body >= 0:
        middle = 0.5 * (occupancy.rear_m[body] + occupancy.front_m[body])
        if occupancy.actor[body] != actor and middle > s:
            gap = occupancy.rear_m[body] - s - state.half_length[actor]
            if gap < leaders.gap_m[actor]:
                leaders.gap_m[actor] = gap
                leaders.speed[actor] = occupancy.speed[body]
                leaders.actor[actor] = occupancy.actor[body]
            return
        body = occupancy.next[body]


@kernel
def allowed_speed(state: State, lanes: Lanes, tables: TrafficTables, actor: int) -> float:
    """Speed that limits and bends allow here, slowing in time for the lanes ahead [m/s]."""
    lane = state.lane[actor]
    index = int(state.lane_m[actor] / lanes.spacing_m[lane] + 0.5)
    index = min(max(index, 0), lanes.count[lane] - 1)
    speed = tables.point_speed[lanes.first[lane] + index]
    distance = lanes.length_m[lane] - state.lane_m[actor]
    least = FAST_MPS * FAST_MPS
    for step in range(1, PATH_LANES):
        ahead = state.path[actor, step]
        if ahead < 0 or distance > 80.0:
            break
        there = tables.first_speed[ahead]
        least = min(least, there * there + 2.0 * SLOWING_MPS2 * max(distance, 0.0))
        distance += lanes.length_m[ahead]
    speed = min(speed, math.sqrt(least))  # one root: that of the least is the least of the roots
    return max(speed * state.desired_factor[actor], 1.0)


@kernel
def _busy_crosswalk_gap(
    state: State, lanes: Lanes, tables: TrafficTables, busy: Int8, actor: int
) -> float:
    """Distance from the front to the first crosswalk ahead that somebody walks on."""
    front = state.lane_m[actor] + state.half_length[actor]
    offset = -front
    for step in range(PATH_LANES):
        lane = state.path[actor, step]
        if lane < 0 or offset > 60.0:
            break
        for k in range(tables.crossing_start[lane], tables.crossing_start[lane + 1]):
            gap = offset + tables.crossing_begin_m[k]
            if busy[tables.crossing[k]] and gap > -0.5:
                return gap
        offset += lanes.length_m[lane]
    return NO_LEADER_M


@kernel
def choose_speed(
    state: State,
    lanes: Lanes,
    tables: TrafficTables,
    leaders: Leaders,
    requests: Requests,
    busy: Int8,
    egos: int,
    actor: int,
) -> tuple[float, float]:
    """The acceleration that a vehicle wants, and the highest speed that is safe, this tick.

    Returns:
        (acceleration [m/s2], speed cap [m/s]).
    """
    speed = state.speed[actor]
    desired = allowed_speed(state, lanes, tables, actor)
    gap, leader_speed = leaders.gap_m[actor], leaders.speed[actor]
    acceleration = idm_acceleration(speed, desired, gap, leader_speed)
    cap = NO_LEADER_M
    if gap < NO_LEADER_M:
        leader_braking = EMERGENCY_BRAKING_MPS2 if leaders.actor[actor] < egos else MAX_BRAKING_MPS2
        cap = safe_speed(gap - SAFE_GAP_M, leader_speed, MAX_BRAKING_MPS2, leader_braking)
    line = _busy_crosswalk_gap(state, lanes, tables, busy, actor)
    line = min(line, requests.line_m[actor])
    if line < NO_LEADER_M:
        # as if somebody stood where stopping behind them means stopping at the line
        stand_in = line - LINE_GAP_M + DISTANCE_WANTED_M - CAR_LENGTH_M
        acceleration = min(acceleration, idm_acceleration(speed, desired, stand_in, 0.0))
        cap = min(cap, safe_speed(line - SAFE_GAP_M, 0.0, MAX_BRAKING_MPS2, MAX_BRAKING_MPS2))
        if line < STOP_ZONE_M and speed < 0.3 and acceleration < 0.3:
            cap = 0.0
    return min(max(acceleration, -MAX_BRAKING_MPS2), ACCELERATION_MPS2), cap
