"""How vehicles move along their lanes: drawn ways, lane changes under way, axles on the lane."""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, keyed_hash
from di_envs.town.lanes import Lanes
from di_envs.town.queries import pose_at
from di_envs.world.state import PATH_LANES, TAIL_LANES, TICK_S, ActorKind, State
from di_envs.world.traffic.approach import Requests, find_entry, lane_behind
from di_envs.world.traffic.car_following import EMERGENCY_BRAKING_MPS2
from di_envs.world.traffic.tables import TrafficTables

STILL_MPS = 0.1
LATERAL_SPEED_MPS = 1.2  # of a lane change
LATERAL_SHARE = 0.25  # of the forward speed, at most
INDICATE_M = 30.0
BRAKE_LIGHT_MPS2 = -0.8
AXLE_SHARE = 0.6  # of half the length, from the middle to an axle
REROUTE_TICKS = round(20.0 / TICK_S)  # of standing still after which one leaves a shut way …
REROUTE_EVERY_TICKS = round(2.0 / TICK_S)  # … to others, if the next draw is another way

_ABSENT = int(ActorKind.ABSENT)
_TURN_STREAM = int(Stream.TRAFFIC_TURN)


@kernel
def next_lane(
    lanes: Lanes, tables: TrafficTables, lane: int, seed: int, tick: int, actor: int, step: int
) -> int:
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
def choose_path(state: State, lanes: Lanes, tables: TrafficTables, actor: int, known: int) -> None:
    """Fills a vehicle's path behind its first `known` lanes with drawn ones."""
    seed, tick = int(state.seed[()]), int(state.tick[()])
    for step in range(known, PATH_LANES):
        last, ahead = state.path[actor, step - 1], -1
        if last >= 0:
            ahead = next_lane(lanes, tables, last, seed, tick, actor, step)
        state.path[actor, step] = ahead


@kernel
def take_another_way(
    state: State,
    lanes: Lanes,
    tables: TrafficTables,
    requests: Requests,
    egos: int,
    vehicle_end: int,
) -> None:
    """Who has long stood before a shut way draws a new path: so a ring of full streets dissolves.

    In such a ring everybody waits for room in the next street, and none of them for a mistake.
    """
    for actor in range(egos, vehicle_end):
        still = state.still_ticks[actor]
        if requests.shut[actor] and still >= REROUTE_TICKS and still % REROUTE_EVERY_TICKS == 0:
            if requests.way_step[actor] >= 1:
                choose_path(state, lanes, tables, actor, requests.way_step[actor])


@kernel
def move_vehicle(
    state: State, lanes: Lanes, tables: TrafficTables, actor: int, acceleration: float, cap: float
) -> None:
    """Moves a vehicle along its path for one tick and places its body.

    It gains `acceleration` [m/s2], up to the speed `cap` [m/s], but brakes no harder than it can.
    """
    speed = state.speed[actor]
    moved = min(speed + acceleration * TICK_S, cap)
    moved = max(moved, speed - EMERGENCY_BRAKING_MPS2 * TICK_S, 0.0)
    state.acceleration[actor] = (moved - speed) / TICK_S
    state.speed[actor] = moved
    state.lane_m[actor] += moved * TICK_S
    state.still_ticks[actor] = state.still_ticks[actor] + 1 if moved < STILL_MPS else 0
    while state.lane_m[actor] >= lanes.length_m[state.lane[actor]]:
        if state.path[actor, 1] < 0:
            leave_town(state, actor)
            return
        _enter_next_lane(state, lanes, tables, actor)
    _drift_to_centre(state, actor, moved)
    state.brake_light[actor] = 1 if state.acceleration[actor] < BRAKE_LIGHT_MPS2 else 0
    state.indicator[actor] = _indicator(state, lanes, actor)
    if speed == 0.0 and moved == 0.0 and _keeps_place(state, lanes, actor):
        state.yaw_rate[actor] = 0.0
        return
    yaw = state.yaw[actor]
    place_vehicle(state, lanes, actor)
    turn = state.yaw[actor] - yaw
    turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
    state.yaw_rate[actor] = turn / TICK_S


@kernel
def _keeps_place(state: State, lanes: Lanes, actor: int) -> bool:
    """Whether a vehicle that stood and stands is where it was placed: it need not be again.

    Not who was hit, who may have been thrown, nor who changes lanes, whose yaw depends on the speed
    before; nor where the front axle is on the next lane, for the way may have been drawn anew.
    """
    if state.lateral_m[actor] != 0.0 or state.shock_ticks[actor] > 0:
        return False
    front_m = state.lane_m[actor] + AXLE_SHARE * state.half_length[actor]
    return front_m <= lanes.length_m[state.lane[actor]]


@kernel
def leave_town(state: State, actor: int) -> None:
    """Takes a vehicle off the road at an open end; `returning` brings it back elsewhere."""
    state.away[actor] = state.kind[actor]
    state.kind[actor] = _ABSENT
    state.speed[actor] = state.acceleration[actor] = state.yaw_rate[actor] = 0.0
    forget_way(state, actor)
    state.lane[actor] = -1


@kernel
def forget_way(state: State, actor: int) -> None:
    """Clears where a vehicle came from, goes, and may go: what holds for who is newly set down."""
    state.path[actor] = -1
    state.previous_lane[actor] = state.changing_from[actor] = -1
    state.earlier_lanes[actor] = -1
    state.grant[actor] = -1
    state.grant_steps[actor] = 0
    state.arrival_tick[actor] = -1
    state.stopped_at[actor] = -1
    state.still_ticks[actor] = 0
    state.lateral_m[actor] = 0.0
    state.brake_light[actor] = state.indicator[actor] = 0


@kernel
def _enter_next_lane(state: State, lanes: Lanes, tables: TrafficTables, actor: int) -> None:
    """Goes on to the path's next lane at the end of one."""
    lane, ahead = state.lane[actor], state.path[actor, 1]
    state.lane_m[actor] -= lanes.length_m[lane]
    state.lane[actor] = ahead
    for step in range(TAIL_LANES - 1, 0, -1):
        state.earlier_lanes[actor, step] = state.earlier_lanes[actor, step - 1]
    state.earlier_lanes[actor, 0] = state.previous_lane[actor]
    state.previous_lane[actor] = lane
    state.changing_from[actor] = -1
    if state.grant_steps[actor] > 0:
        state.grant_steps[actor] -= 1
    if lanes.junction[ahead] >= 0:
        state.arrival_tick[actor] = state.stopped_at[actor] = -1
    for step in range(PATH_LANES - 1):
        state.path[actor, step] = state.path[actor, step + 1]
    choose_path(state, lanes, tables, actor, PATH_LANES - 1)


@kernel
def _drift_to_centre(state: State, actor: int, speed: float) -> None:
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
def _indicator(state: State, lanes: Lanes, actor: int) -> int:
    """-1 left, 0 off, 1 right: for a lane change under way, or a turn taken or soon to come."""
    if state.lateral_m[actor] != 0.0:
        return 1 if state.lateral_m[actor] < 0.0 else -1
    lane = state.lane[actor]
    if lanes.junction[lane] < 0:
        step, _ = find_entry(state, lanes, actor, 1, INDICATE_M)
        if step > 0:
            lane = state.path[actor, step]
    turn = lanes.turn[lane]
    return -1 if turn == 1 else (1 if turn == 2 else 0)


@kernel
def place_vehicle(state: State, lanes: Lanes, actor: int) -> None:
    """Sets a vehicle's pose: its axles run on the lane, so long bodies swing as they do."""
    axle = AXLE_SHARE * state.half_length[actor]
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
def _point_on_path(
    state: State, lanes: Lanes, actor: int, ahead_m: float
) -> tuple[float, float, float, float]:
    """(x, y, z, yaw) of its lanes' centre `ahead_m` before a vehicle's middle, or behind it."""
    s = state.lane_m[actor] + ahead_m
    lane = state.lane[actor]
    step = 0
    while s < 0.0 and step <= TAIL_LANES:
        before = lane_behind(state, actor, step)
        if before < 0:
            return pose_at(lanes, lane, s)
        lane = before
        s += lanes.length_m[lane]
        step += 1
    step = 1
    while s > lanes.length_m[lane] and step < PATH_LANES and state.path[actor, step] >= 0:
        s -= lanes.length_m[lane]
        lane = state.path[actor, step]
        step += 1
    return pose_at(lanes, lane, s)
