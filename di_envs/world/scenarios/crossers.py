"""Scenarios 3 and 4: somebody crosses right before the ego, from behind something or after a turn.

He waits beside the road until the ego is near, then goes straight across to the far side and is
gone. He does not look out for his ego, only for others: he stops rather than walk into a side, and
for who could not stop for him; the ego has to.
Source: CARLA scenario_runner, branch `leaderboard-1.0`, `DynamicObjectCrossing` (always a walker,
gone in the middle of the road) and `VehicleTurningRoute` (stops beyond the lane for 5 s).
"""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Float64, Int32
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, Signals
from di_envs.town.lanes_below import lanes_below_box
from di_envs.town.queries import project_to_lane
from di_envs.world.bodies import LARGEST_M, SAME_LEVEL_M, Box, box_of, overlap
from di_envs.world.scenarios.steps import draw_of, end_scenario, go_to, put_actor
from di_envs.world.scenarios.tables import (
    MACHINE_HALF_LENGTH_M,
    MACHINE_HALF_WIDTH_M,
    MACHINE_HEIGHT_M,
    ScenarioTables,
)
from di_envs.world.state import OCCUPIED_LANES, TICK_S, ActorKind, State
from di_envs.world.struck import DOWN, lie
from di_envs.world.traffic.occupancy import Occupancy, insert_body
from di_envs.world.walkers.crossing import BODY_M, is_in_the_way
from di_envs.world.walkers.neighbours import is_vehicle
from di_envs.world.walkers.spawn import HEIGHT_M

WAITING, CROSSING = 1, 2
HIDDEN = 3  # the type with somebody behind a vending machine
CYCLIST_SHARE = 0.25  # of those who step out from behind something; CARLA has none
CYCLIST_HALF_LENGTH_M, CYCLIST_HALF_WIDTH_M, CYCLIST_HEIGHT_M = 0.9, 0.3, 1.7
LOOK_S = 1.5  # of other vehicles' ways that he does not step into …
SHOWN_S = 1.0  # … and of his own that they take for occupied
CLEAR_M = 0.35  # kept from vehicles
WALKER_ROOM_M = 0.6  # kept from walkers ahead
BEHIND_EGO_M = 2.0  # to the side: followers of the ego stop when it does
GIVE_UP_TICKS = round(10.0 / TICK_S)  # of standing in the way of each other
TRIES = 20  # of finding a place free of others, …
SHIFT_M = 0.4  # … each so far along the road

ABSENT, WALKER = int(ActorKind.ABSENT), int(ActorKind.WALKER)
BICYCLE, DEBRIS = int(ActorKind.BICYCLE), int(ActorKind.DEBRIS)
VENDING_MACHINE = int(ActorKind.VENDING_MACHINE)


@kernel
def begin_crossing(
    state: State, tables: ScenarioTables, signals: Signals, trigger: int, ego: int
) -> None:
    """Puts somebody, and what hides him, beside the road where there is room."""
    actor = tables.first_actor[trigger]
    slot = actor - tables.first_actor[0]
    pose = tables.pose[slot]
    rides = tables.type[trigger] != HIDDEN or draw_of(state, tables, ego, trigger, 0) < (
        CYCLIST_SHARE
    )
    half_length = CYCLIST_HALF_LENGTH_M if rides else BODY_M
    half_width = CYCLIST_HALF_WIDTH_M if rides else BODY_M
    shift = (
        -1.0
        if math.isnan(pose[0])
        else _free_shift(state, tables, trigger, slot, half_length, half_width)
    )
    if shift < 0.0:  # no place for him
        end_scenario(state, tables, signals, trigger)
        return
    along_x, along_y = _along_road(pose)
    along_x, along_y = shift * along_x, shift * along_y
    put_actor(
        state,
        actor,
        BICYCLE if rides else WALKER,
        pose[0] + along_x,
        pose[1] + along_y,
        pose[2],
        pose[3],
        half_length,
        half_width,
        CYCLIST_HEIGHT_M if rides else HEIGHT_M,
    )
    state.walk_waiting[actor] = 0
    state.still_ticks[actor] = 0
    state.shock_ticks[actor] = 0
    if tables.type[trigger] == HIDDEN:
        place = tables.pose[slot + 1]
        put_actor(
            state,
            actor + 1,
            VENDING_MACHINE,
            place[0] + along_x,
            place[1] + along_y,
            place[2],
            place[3],
            MACHINE_HALF_LENGTH_M,
            MACHINE_HALF_WIDTH_M,
            MACHINE_HEIGHT_M,
        )
    state.scenario_m[trigger] = 0.0
    go_to(state, trigger, WAITING)


@kernel
def _free_shift(
    state: State,
    tables: ScenarioTables,
    trigger: int,
    slot: int,
    half_length: float,
    half_width: float,
) -> float:
    """How far along the road the first place free of others is [m]; -1 where none is near."""
    along_x, along_y = _along_road(tables.pose[slot])
    for k in range(TRIES):
        dx, dy = SHIFT_M * k * along_x, SHIFT_M * k * along_y
        free = _is_place_free(state, tables.pose[slot], dx, dy, half_length, half_width)
        if free and tables.type[trigger] == HIDDEN:
            machine = tables.pose[slot + 1]
            free = _is_place_free(
                state, machine, dx, dy, MACHINE_HALF_LENGTH_M, MACHINE_HALF_WIDTH_M
            )
        if free:
            return SHIFT_M * k
    return -1.0


@kernel
def _along_road(pose: Float64) -> tuple[float, float]:
    """The direction in which the road runs before somebody who faces it from its right side.

    Args:
        pose: (4,) x, y, z, yaw of him.

    Returns:
        (x, y) of a unit vector, world frame.
    """
    return -math.sin(pose[3]), math.cos(pose[3])


@kernel
def _is_place_free(
    state: State, pose: Float64, dx: float, dy: float, half_length: float, half_width: float
) -> bool:
    """Whether nobody's box reaches into one at a pose (4,) x, y, z, yaw, moved by (dx, dy) [m]."""
    x, y = pose[0] + dx, pose[1] + dy
    place = Box(x, y, pose[2], pose[3], half_length, half_width)
    for other in range(state.kind.size):
        if state.kind[other] == ABSENT or state.kind[other] == DEBRIS:
            continue
        if abs(state.x[other] - x) > LARGEST_M or abs(state.y[other] - y) > LARGEST_M:
            continue
        if abs(state.z[other] - pose[2]) >= SAME_LEVEL_M:
            continue
        if overlap(place, box_of(state, other))[0] > 0.0:
            return False
    return True


@kernel
def _is_held(
    state: State, actor: int, ego: int, step_m: float, vehicle_end: int, walker_end: int
) -> bool:
    """Whether a step would go into a vehicle's side, into the way of one that is not his ego, or
    into one of the walkers, who are the actors behind `vehicle_end`."""
    cos, sin = math.cos(state.yaw[actor]), math.sin(state.yaw[actor])
    x = state.x[actor] + state.half_length[actor] * cos
    y = state.y[actor] + state.half_length[actor] * sin
    ego_cos, ego_sin = math.cos(state.yaw[ego]), math.sin(state.yaw[ego])
    for other in range(vehicle_end):
        if not is_vehicle(state.kind[other]):
            continue
        look_s = LOOK_S
        dx, dy = state.x[other] - state.x[ego], state.y[other] - state.y[ego]
        behind = dx * ego_cos + dy * ego_sin <= 0.0
        if other == ego or (behind and abs(dy * ego_cos - dx * ego_sin) < BEHIND_EGO_M):
            look_s = 0.0
        if is_in_the_way(
            state,
            other,
            x,
            y,
            state.z[actor],
            state.yaw[actor],
            step_m,
            CLEAR_M - BODY_M,
            look_s,
        ):
            return True
    for other in range(vehicle_end, walker_end):
        dx, dy = state.x[other] - x, state.y[other] - y
        if dx * dx + dy * dy > WALKER_ROOM_M * WALKER_ROOM_M or state.kind[other] != WALKER:
            continue
        if dx * cos + dy * sin > 0.0 and abs(state.z[other] - state.z[actor]) < SAME_LEVEL_M:
            return True
    return False


@kernel
def move_crosser(
    state: State,
    tables: ScenarioTables,
    signals: Signals,
    trigger: int,
    ego: int,
    vehicle_end: int,
    walker_end: int,
) -> None:
    """One tick of who crosses; at the far side, or when nothing moves any more, he is gone."""
    actor = tables.first_actor[trigger]
    if state.kind[actor] == ABSENT:  # somebody took him away
        end_scenario(state, tables, signals, trigger)
        return
    if state.walk_waiting[actor] == DOWN:
        if lie(state, actor):
            end_scenario(state, tables, signals, trigger)
        return
    if state.scenario_step[trigger] != CROSSING:
        return
    before = state.speed[actor]
    step_m = tables.speed_mps[trigger] * TICK_S
    if _is_held(state, actor, ego, step_m, vehicle_end, walker_end):
        state.speed[actor] = 0.0
        state.still_ticks[actor] += 1
    else:
        state.speed[actor] = tables.speed_mps[trigger]
        state.still_ticks[actor] = 0
        state.x[actor] += step_m * math.cos(state.yaw[actor])
        state.y[actor] += step_m * math.sin(state.yaw[actor])
        state.scenario_m[trigger] += step_m
    state.acceleration[actor] = (state.speed[actor] - before) / TICK_S
    arrived = state.scenario_m[trigger] >= tables.crossing_m[trigger]
    if arrived or state.still_ticks[actor] > GIVE_UP_TICKS:
        end_scenario(state, tables, signals, trigger)


@kernel
def watch_crossing(state: State, tables: ScenarioTables, trigger: int, done_m: float) -> None:
    """Lets him go once the ego is near enough."""
    if state.scenario_step[trigger] == WAITING and done_m >= tables.begin_m[trigger]:
        go_to(state, trigger, CROSSING)


@kernel
def occupy_lanes(
    occupancy: Occupancy,
    state: State,
    tables: ScenarioTables,
    lanes: Lanes,
    trigger: int,
    below: Int32,
) -> None:
    """Enters who crosses into the lists of the lanes that he is on or comes to within a second.

    Args:
        occupancy: Lists of bodies by lane.
        state: The world.
        tables: `ScenarioTables`.
        lanes: The town's lanes.
        trigger: His trigger.
        below: (OCCUPIED_LANES,) int32 scratch.
    """
    actor = tables.first_actor[trigger]
    down = state.walk_waiting[actor] == DOWN
    if state.kind[actor] == ABSENT or (state.scenario_step[trigger] != CROSSING and not down):
        return
    ahead = 0.0 if down else 0.5 * SHOWN_S * tables.speed_mps[trigger]
    half_length, half_width = state.half_length[actor] + ahead, state.half_width[actor]
    x = state.x[actor] + ahead * math.cos(state.yaw[actor])
    y = state.y[actor] + ahead * math.sin(state.yaw[actor])
    z, yaw = state.z[actor], state.yaw[actor]
    lanes_below_box(lanes, x, y, z, yaw, half_length, half_width, below)
    for k in range(OCCUPIED_LANES):
        if below[k] < 0:
            break
        s, _ = project_to_lane(lanes, below[k], x, y)
        point = lanes.first[below[k]] + min(
            max(int(s / lanes.spacing_m[below[k]]), 0), lanes.count[below[k]] - 1
        )
        angle = yaw - lanes.points[point, 3]
        along = abs(math.cos(angle)) * half_length + abs(math.sin(angle)) * half_width
        speed = max(state.speed[actor] * math.cos(angle), 0.0)
        insert_body(occupancy, below[k], actor, s - along, s + along, speed)
