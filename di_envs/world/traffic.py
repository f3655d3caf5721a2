# mypy: disallow_untyped_defs=False
"""Traffic: vehicles that follow lanes, keep gaps, obey lights and signs, and yield.

Source: Intelligent Driver Model (Treiber, Hennecke, Helbing: Congested traffic states in empirical
observations and microscopic simulations, Phys. Rev. E 62, 2000) with highway-env's parameters and
form (`highway_env.vehicle.behavior.IDMVehicle`, Leurent 2018); the speed is capped besides by what
lets one stop behind a leader that brakes as hard as it can (Gipps: A behavioural car-following
model for computer simulation, Transportation Research B 15, 1981).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.bundles import by_reference
from di_envs.kernels import kernel
from di_envs.keyed_random import Stream, keyed_hash
from di_envs.town.lanes import LaneKind
from di_envs.town.queries import pose_at
from di_envs.world.occupancy import NO_LEADER_M, find_leader
from di_envs.world.right_of_way import STOP_ZONE_M
from di_envs.world.state import PATH_LANES, TICK_S, ActorKind
from di_envs.world.traffic_tables import SLOWING_MPS2

# highway-env's IDM parameters; distances there are between the middles of 5 m cars
ACCELERATION_MPS2 = 3.0
COMFORT_BRAKING_MPS2 = 5.0
DISTANCE_WANTED_M = 10.0
CAR_LENGTH_M = 5.0
TIME_WANTED_S = 1.5
MAX_BRAKING_MPS2 = 6.0
EMERGENCY_BRAKING_MPS2 = 8.0  # also what an ego can do

LINE_GAP_M = 0.8  # at which vehicles stop before a line
SAFE_GAP_M = 0.4
STILL_MPS = 0.1
LATERAL_SPEED_MPS = 1.2  # of a lane change
LATERAL_SHARE = 0.25  # of the forward speed, at most
INDICATE_M = 30.0
BRAKE_LIGHT_MPS2 = -0.8
REROUTE_TICKS = round(20.0 / TICK_S)  # of standing still after which one leaves a full exit …
REROUTE_EVERY_TICKS = round(2.0 / TICK_S)  # … to others, if the next draw is another way

_ABSENT = int(ActorKind.ABSENT)
_DRIVING = int(LaneKind.DRIVING)
_TURN_STREAM = int(Stream.TRAFFIC_TURN)


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
def idm_acceleration(speed, desired_speed, gap_m, leader_speed):
    """The Intelligent Driver Model's acceleration, as highway-env has it.

    Args:
        speed: Own speed [m/s].
        desired_speed: Speed wanted on a free road [m/s], positive.
        gap_m: Free distance to the leader, bumper to bumper; NO_LEADER_M for none.
        leader_speed: Its speed along the lane [m/s].

    Returns:
        Acceleration [m/s2], not clipped.
    """
    ratio = max(speed, 0.0) / desired_speed
    free = 1.0 - ratio * ratio * ratio * ratio
    if gap_m >= NO_LEADER_M:
        return ACCELERATION_MPS2 * free
    wanted = (
        DISTANCE_WANTED_M
        + speed * TIME_WANTED_S
        + speed
        * (speed - leader_speed)
        / (2.0 * math.sqrt(ACCELERATION_MPS2 * COMFORT_BRAKING_MPS2))
    )
    share = max(wanted, 0.0) / max(gap_m + CAR_LENGTH_M, 0.1)
    return ACCELERATION_MPS2 * (free - share * share)


@kernel
def safe_speed(gap_m, leader_speed, braking_mps2, leader_braking_mps2):
    """The highest speed for the next tick from which one can stop behind the leader.

    It holds for a leader that brakes at `leader_braking_mps2` from now on, and for oneself braking
    at `braking_mps2` from the next tick on.
    """
    room = max(gap_m, 0.0) + leader_speed * leader_speed / (2.0 * leader_braking_mps2)
    step = braking_mps2 * TICK_S
    return max(-step + math.sqrt(step * step + 2.0 * braking_mps2 * room), 0.0)


@kernel
def find_leaders(leaders, occupancy, state, lanes, tables, egos, vehicle_end):
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
def _leader_on_old_lane(leaders, occupancy, state, lanes, actor):
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
def allowed_speed(state, lanes, tables, actor):
    """Speed that limits and bends allow here, slowing in time for the lanes ahead [m/s]."""
    lane = state.lane[actor]
    index = int(state.lane_m[actor] / lanes.spacing_m[lane] + 0.5)
    index = min(max(index, 0), lanes.count[lane] - 1)
    speed = tables.point_speed[lanes.first[lane] + index]
    distance = lanes.length_m[lane] - state.lane_m[actor]
    for step in range(1, PATH_LANES):
        ahead = state.path[actor, step]
        if ahead < 0 or distance > 80.0:
            break
        there = tables.point_speed[lanes.first[ahead]]
        speed = min(speed, math.sqrt(there * there + 2.0 * SLOWING_MPS2 * max(distance, 0.0)))
        distance += lanes.length_m[ahead]
    return max(speed * state.desired_factor[actor], 1.0)


@kernel
def _busy_crosswalk_gap(state, lanes, tables, busy, actor):
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
def choose_speed(state, lanes, tables, leaders, requests, busy, egos, actor):
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
    if requests.way[actor] >= 0 and state.grant[actor] != requests.way[actor]:
        line = min(line, requests.distance_m[actor])
    if line < NO_LEADER_M:
        # as if somebody stood where stopping behind them means stopping at the line
        stand_in = line - LINE_GAP_M + DISTANCE_WANTED_M - CAR_LENGTH_M
        acceleration = min(acceleration, idm_acceleration(speed, desired, stand_in, 0.0))
        cap = min(cap, safe_speed(line - SAFE_GAP_M, 0.0, MAX_BRAKING_MPS2, MAX_BRAKING_MPS2))
        if line < STOP_ZONE_M and speed < 0.3 and acceleration < 0.3:
            cap = 0.0
    return min(max(acceleration, -MAX_BRAKING_MPS2), ACCELERATION_MPS2), cap


@kernel
def next_lane(lanes, tables, lane, seed, tick, actor, step):
    """Draws where a vehicle goes on at the end of a lane; -1 where no usable lane follows."""
    count = 0
    for k in range(lanes.successor_start[lane], lanes.successor_start[lane + 1]):
        count += tables.usable[lanes.successor[k]]
    if count == 0:
        return -1
    draw = keyed_hash(seed, _TURN_STREAM, tick, actor * PATH_LANES + step)
    pick = int(draw % np.uint64(count))
    for k in range(lanes.successor_start[lane], lanes.successor_start[lane + 1]):
        if tables.usable[lanes.successor[k]]:
            if pick == 0:
                return lanes.successor[k]
            pick -= 1
    return -1


@kernel
def choose_path(state, lanes, tables, actor, known):
    """Fills a vehicle's path behind its first `known` lanes with drawn ones."""
    for step in range(known, PATH_LANES):
        last = state.path[actor, step - 1]
        state.path[actor, step] = (
            -1
            if last < 0
            else next_lane(lanes, tables, last, state.seed[()], state.tick[()], actor, step)
        )


@kernel
def take_another_way(state, lanes, tables, requests, egos, vehicle_end):
    """Who has long stood before a full exit draws a new path: so a ring of full streets dissolves.

    In such a ring everybody waits for room in the next street, and none of them for a mistake.
    """
    for actor in range(egos, vehicle_end):
        still = state.still_ticks[actor]
        if requests.full[actor] and still >= REROUTE_TICKS and still % REROUTE_EVERY_TICKS == 0:
            if requests.way_step[actor] == 1 and state.grant[actor] < 0:
                choose_path(state, lanes, tables, actor, 1)


@kernel
def move_vehicle(state, lanes, tables, actor, acceleration, cap):
    """Moves a vehicle along its path for one tick and places its body."""
    speed = state.speed[actor]
    moved = min(speed + acceleration * TICK_S, cap)
    moved = max(moved, speed - EMERGENCY_BRAKING_MPS2 * TICK_S, 0.0)
    state.acceleration[actor] = (moved - speed) / TICK_S
    state.speed[actor] = moved
    state.lane_m[actor] += moved * TICK_S
    state.still_ticks[actor] = state.still_ticks[actor] + 1 if moved < STILL_MPS else 0
    _enter_next_lane(state, lanes, tables, actor)
    _drift_to_centre(state, actor, moved)
    state.brake_light[actor] = 1 if state.acceleration[actor] < BRAKE_LIGHT_MPS2 else 0
    state.indicator[actor] = _indicator(state, lanes, actor)
    yaw = state.yaw[actor]
    place_vehicle(state, lanes, actor)
    turn = state.yaw[actor] - yaw
    turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
    state.yaw_rate[actor] = turn / TICK_S


@kernel
def _enter_next_lane(state, lanes, tables, actor):
    lane = state.lane[actor]
    if state.lane_m[actor] < lanes.length_m[lane]:
        return
    ahead = state.path[actor, 1]
    if ahead < 0:
        state.lane_m[actor] = lanes.length_m[lane]
        state.speed[actor] = 0.0
        return
    state.lane_m[actor] -= lanes.length_m[lane]
    state.lane[actor] = ahead
    state.previous_lane[actor] = lane
    state.changing_from[actor] = -1
    for step in range(PATH_LANES - 1):
        state.path[actor, step] = state.path[actor, step + 1]
    choose_path(state, lanes, tables, actor, PATH_LANES - 1)


@kernel
def _drift_to_centre(state, actor, speed):
    """Goes on with a lane change: sideways no faster than the forward speed lets it look real."""
    offset = state.lateral_m[actor]
    if offset == 0.0:
        return
    step = min(LATERAL_SPEED_MPS, LATERAL_SHARE * speed) * TICK_S
    if abs(offset) <= step:
        state.lateral_m[actor] = 0.0
        state.changing_from[actor] = -1
    else:
        state.lateral_m[actor] = offset - math.copysign(step, offset)


@kernel
def _indicator(state, lanes, actor):
    if state.lateral_m[actor] != 0.0:
        return 1 if state.lateral_m[actor] < 0.0 else -1
    lane = state.lane[actor]
    if lanes.length_m[lane] - state.lane_m[actor] < INDICATE_M and state.path[actor, 1] >= 0:
        if lanes.junction[lane] < 0:
            lane = state.path[actor, 1]
    turn = lanes.turn[lane]
    return -1 if turn == 1 else (1 if turn == 2 else 0)


@kernel
def place_vehicle(state, lanes, actor):
    """Sets a vehicle's pose: its axles run on the lane, so long bodies swing as they do."""
    axle = 0.6 * state.half_length[actor]
    front_x, front_y, front_z, _ = _point_on_path(state, lanes, actor, axle)
    rear_x, rear_y, rear_z, _ = _point_on_path(state, lanes, actor, -axle)
    yaw = math.atan2(front_y - rear_y, front_x - rear_x)
    lateral = state.lateral_m[actor]
    if lateral != 0.0:
        side_x, side_y = -math.sin(yaw) * lateral, math.cos(yaw) * lateral
        front_x, front_y = front_x + side_x, front_y + side_y
        rear_x, rear_y = rear_x + side_x, rear_y + side_y
        share = min(LATERAL_SPEED_MPS / max(state.speed[actor], 1e-3), LATERAL_SHARE)
        yaw -= math.copysign(math.atan(share * min(1.0, abs(lateral))), lateral)
    state.x[actor] = 0.5 * (front_x + rear_x)
    state.y[actor] = 0.5 * (front_y + rear_y)
    state.z[actor] = 0.5 * (front_z + rear_z)
    state.yaw[actor] = yaw


@kernel
def _point_on_path(state, lanes, actor, ahead_m):
    s = state.lane_m[actor] + ahead_m
    lane = state.lane[actor]
    if s < 0.0 and state.previous_lane[actor] >= 0:
        before = state.previous_lane[actor]
        return pose_at(lanes, before, lanes.length_m[before] + s)
    if s > lanes.length_m[lane] and state.path[actor, 1] >= 0:
        return pose_at(lanes, state.path[actor, 1], s - lanes.length_m[lane])
    return pose_at(lanes, lane, s)
