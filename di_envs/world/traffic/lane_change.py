"""Lane changes of traffic: MOBIL, with highway-env's parameters.

Source: Kesting, Treiber, Helbing: General lane-changing model MOBIL for car-following models,
Transportation Research Record 1999 (2007); parameters and form of highway-env's `IDMVehicle.mobil`.
"""

from __future__ import annotations

from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes
from di_envs.town.queries import project_to_lane, width_at
from di_envs.world.state import TICK_S, ActorKind, State
from di_envs.world.traffic.car_following import (
    ACCELERATION_MPS2,
    MAX_BRAKING_MPS2,
    NO_LEADER_M,
    idm_acceleration,
    safe_speed,
)
from di_envs.world.traffic.motion import choose_path
from di_envs.world.traffic.occupancy import (
    Occupancy,
    body_ahead,
    body_behind,
    find_leader,
    insert_body,
)
from di_envs.world.traffic.speed_choice import SAFE_GAP_M, allowed_speed
from di_envs.world.traffic.tables import TrafficTables

MIN_GAIN_MPS2 = 0.2
MAX_BRAKING_IMPOSED_MPS2 = 2.0
DELAY_TICKS = round(1.0 / TICK_S)
MIN_SPEED_MPS = 1.0
MIN_GAP_M = 2.0
ROOM_TIME_S = 4.5  # a change must end before its lane does
ROOM_M = 25.0
LOOK_M = 100.0
SIDE_M = 0.2  # of its new lane that a vehicle leaves free on either side

_ABSENT = int(ActorKind.ABSENT)
_CHANGE_LEFT, _CHANGE_RIGHT = 1, 2


@kernel
def change_lanes(
    occupancy: Occupancy,
    state: State,
    lanes: Lanes,
    tables: TrafficTables,
    egos: int,
    vehicle_end: int,
) -> None:
    """Lets each vehicle, once a second, begin a lane change that MOBIL recommends."""
    for actor in range(egos, vehicle_end):
        if (state.tick[()] + actor) % DELAY_TICKS != 0 or state.kind[actor] == _ABSENT:
            continue
        lane, s, speed = state.lane[actor], state.lane_m[actor], state.speed[actor]
        if speed < MIN_SPEED_MPS or state.lateral_m[actor] != 0.0 or state.grant[actor] >= 0:
            continue
        if lanes.junction[lane] >= 0 or s < 2.0 * state.half_length[actor]:
            continue
        if lanes.length_m[lane] - s < ROOM_M + ROOM_TIME_S * speed:
            continue
        permitted = lanes.change[lanes.first[lane] + int(s / lanes.spacing_m[lane])]
        for side in range(2):
            target = lanes.left[lane] if side == 0 else lanes.right[lane]
            bit = _CHANGE_LEFT if side == 0 else _CHANGE_RIGHT
            if target >= 0 and permitted & bit and tables.usable[target]:
                if _mobil(occupancy, state, lanes, tables, actor, target):
                    _begin_change(occupancy, state, lanes, tables, actor, target)
                    break


@kernel
def _mobil(
    occupancy: Occupancy, state: State, lanes: Lanes, tables: TrafficTables, actor: int, target: int
) -> bool:
    """Whether a change gains enough and is safe for the new follower and for the vehicle itself.

    A lane that only begins there, and is still too narrow, is none to change to.
    """
    speed = state.speed[actor]
    half = state.half_length[actor]
    s, _ = project_to_lane(lanes, target, state.x[actor], state.y[actor])
    if width_at(lanes, target, s) < 2.0 * (state.half_width[actor] + SIDE_M):
        return False
    desired = allowed_speed(state, lanes, tables, actor)
    ahead = body_ahead(occupancy, target, actor, s)
    gap, ahead_speed = NO_LEADER_M, 0.0
    if ahead >= 0:
        gap = occupancy.rear_m[ahead] - s - half
        ahead_speed = occupancy.speed[ahead]
        if gap < MIN_GAP_M or speed > safe_speed(
            gap - SAFE_GAP_M, ahead_speed, MAX_BRAKING_MPS2, MAX_BRAKING_MPS2
        ):
            return False
    gained = idm_acceleration(speed, desired, gap, ahead_speed)
    if gained < -MAX_BRAKING_IMPOSED_MPS2:
        return False
    if not _follower_is_safe(occupancy, state, lanes, actor, target, s):
        return False
    here = state.lane_m[actor]
    gap, ahead_speed, _ = find_leader(
        occupancy, lanes, tables, state.path[actor], actor, here, here + half, LOOK_M
    )
    present = idm_acceleration(speed, desired, gap, ahead_speed)
    present = max(present, -ACCELERATION_MPS2)
    return min(gained, ACCELERATION_MPS2) - present >= MIN_GAIN_MPS2


@kernel
def _follower_is_safe(
    occupancy: Occupancy, state: State, lanes: Lanes, actor: int, target: int, s: float
) -> bool:
    """Whether the vehicle behind on the target lane need not brake hard."""
    rear = s - state.half_length[actor]
    behind = body_behind(occupancy, target, actor, s)
    gap = NO_LEADER_M
    if behind >= 0:
        gap = rear - occupancy.front_m[behind]
    else:
        for k in range(lanes.predecessor_start[target], lanes.predecessor_start[target + 1]):
            lane = lanes.predecessor[k]
            body = body_behind(occupancy, lane, actor, NO_LEADER_M)
            if body >= 0 and rear + lanes.length_m[lane] - occupancy.front_m[body] < gap:
                gap = rear + lanes.length_m[lane] - occupancy.front_m[body]
                behind = body
    if behind < 0:
        return True
    if gap < MIN_GAP_M:
        return False
    speed = occupancy.speed[behind]
    if speed > safe_speed(gap - SAFE_GAP_M, state.speed[actor], MAX_BRAKING_MPS2, MAX_BRAKING_MPS2):
        return False
    imposed = idm_acceleration(speed, max(speed, 1.0), gap, state.speed[actor])
    return imposed >= -MAX_BRAKING_IMPOSED_MPS2


@kernel
def _begin_change(
    occupancy: Occupancy, state: State, lanes: Lanes, tables: TrafficTables, actor: int, target: int
) -> None:
    """Moves a vehicle to its new lane, its body still where it was, seen from both lanes."""
    s, lateral = project_to_lane(lanes, target, state.x[actor], state.y[actor])
    half = state.half_length[actor]
    state.changing_from[actor] = state.lane[actor]
    state.change_start_tick[actor] = state.tick[()]
    state.lane[actor] = target
    state.lane_m[actor] = s
    state.lateral_m[actor] = lateral
    state.previous_lane[actor] = -1
    state.earlier_lanes[actor] = -1
    state.path[actor, 0] = target
    choose_path(state, lanes, tables, actor, 1)
    insert_body(occupancy, target, actor, s - half, s + half, state.speed[actor])
