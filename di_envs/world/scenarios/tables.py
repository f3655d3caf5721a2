"""What the scenarios of an episode need that does not change: places, distances, lights, slots."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.numerics.geometry import wrap_angle
from di_envs.town.plan import RoutePlan, ScenarioTrigger
from di_envs.town.town import Town
from di_envs.world.scenarios.places import (
    ARMS,
    ARMS_BY_DEFAULT,
    Pose,
    beside_road,
    crossing_length,
    find_kerb,
    lane_width,
    light_ahead,
    lights_apart_m,
    next_junction,
    other_light,
    point_after,
    road_pose,
)
from di_envs.world.state import TICK_S, State

AHEAD, DONE = 0, 9  # first and last step of every scenario; a fresh record says AHEAD

# Actors that each type brings: debris, somebody and what hides him, a cyclist
ACTORS = {1: 3, 3: 2, 4: 1, 7: 0, 8: 0, 9: 0, 10: 0}

DEBRIS_AT_M = (14.0, 48.0, 74.0)
DEBRIS_END_M = 110.0  # of route behind the trigger, at which the debris is taken away

CROSSER_AHEAD_M, AHEAD_PER_LANE_M = 12.0, 1.5
CROSSER_STARTS_M = 12.0  # before him, and one for each lane
HIDDEN_SHARE = 0.9  # of the way from the trigger to him, at which the vending machine stands …
HIDDEN_BEFORE_M = 1.0  # … but at least so far before him along the road
MACHINE_HALF_LENGTH_M, MACHINE_HALF_WIDTH_M, MACHINE_HEIGHT_M = 0.45, 0.55, 1.9
MACHINE_ROOM_M = 0.3  # between it and the driving lane

CYCLIST_AFTER_M = 8.0  # behind the junction, and one for each lane
CYCLIST_STARTS_M = 13.0  # before him, and the width that he crosses
CYCLIST_MPS = 10.0

RED_S, RED_S_PER_M = 1.5, 0.04


@by_reference
class ScenarioTables(NamedTuple):
    """Triggers G of all egos in a row (ego e has [start[e], start[e + 1])) and their slots S."""

    start: NDArray[np.int32]  # (E + 1,)
    type: NDArray[np.int8]  # (G,) the Leaderboard's number
    point: NDArray[np.int32]  # (G,) route point that triggers it, within its ego's own route
    first_actor: NDArray[np.int32]  # (G,) the actors of trigger g are [first[g], first[g + 1])
    begin_m: NDArray[np.float64]  # (G,) of the ego's route, at which somebody starts to cross
    end_m: NDArray[np.float64]  # (G,) at which the scenario is over
    speed_mps: NDArray[np.float64]  # (G,) of who crosses
    crossing_m: NDArray[np.float64]  # (G,) how far it is to the other side
    signal: NDArray[np.int32]  # (G,) the ego's light, -1 for none
    other_signal: NDArray[np.int32]  # (G,) the light that is green as well
    junction: NDArray[np.int32]  # (G,) theirs
    stop: NDArray[np.float64]  # (G, 3) x, y, z of the ego's stop line
    red_ticks: NDArray[np.int64]  # (G,) for which the ego's light is red
    pose: NDArray[np.float64]  # (S, 4) x, y, z, yaw of each actor


@dataclass(kw_only=True)
class _Row:
    """One trigger's entries; what its family does not need stays as it is."""

    type: int
    point: int
    begin_m: float = math.inf
    end_m: float = math.inf
    speed_mps: float = 0.0
    crossing_m: float = 0.0
    signal: int = -1
    other_signal: int = -1
    junction: int = -1
    stop: tuple[float, float, float] = (0.0, 0.0, 0.0)
    red_ticks: int = 0
    poses: list[Pose] = field(default_factory=list)


def actors_needed(plans: Sequence[RoutePlan]) -> int:
    """How many slots the scenarios of these plans take.

    Raises:
        ValueError: If a trigger's type is none of ours.
    """
    total = 0
    for plan in plans:
        for trigger in plan.scenarios:
            if trigger.type not in ACTORS:
                known = ", ".join(map(str, ACTORS))
                raise ValueError(
                    f"route {plan.route_id} has a trigger of scenario {trigger.type}; there are "
                    f"{known}. Leave it out of the trigger file"
                )
            total += ACTORS[trigger.type]
    return total


def scenario_tables(town: Town, plans: Sequence[RoutePlan], first_actor: int) -> ScenarioTables:
    """Computes the tables of some plans, one an ego; their slots begin at actor `first_actor`."""
    rows = [_row(town, plan, trigger) for plan in plans for trigger in plan.scenarios]
    actors = [0, *(ACTORS[row.type] for row in rows)]
    poses = [_padded(row.poses, ACTORS[row.type]) for row in rows]
    return ScenarioTables(
        start=np.cumsum([0, *(len(plan.scenarios) for plan in plans)]).astype(np.int32),
        type=np.array([row.type for row in rows], np.int8),
        point=np.array([row.point for row in rows], np.int32),
        first_actor=(first_actor + np.cumsum(actors)).astype(np.int32),
        begin_m=np.array([row.begin_m for row in rows], np.float64),
        end_m=np.array([row.end_m for row in rows], np.float64),
        speed_mps=np.array([row.speed_mps for row in rows], np.float64),
        crossing_m=np.array([row.crossing_m for row in rows], np.float64),
        signal=np.array([row.signal for row in rows], np.int32),
        other_signal=np.array([row.other_signal for row in rows], np.int32),
        junction=np.array([row.junction for row in rows], np.int32),
        stop=np.array([row.stop for row in rows], np.float64).reshape(-1, 3),
        red_ticks=np.array([row.red_ticks for row in rows], np.int64),
        pose=np.concatenate([np.zeros((0, 4)), *poses]),
    )


def call_off(state: State, tables: ScenarioTables, actor: int) -> bool:
    """Lets the scenario of an actor never begin; whether it is one's, and had not begun."""
    if not tables.first_actor[0] <= actor < tables.first_actor[-1]:
        return False
    trigger = int(np.searchsorted(tables.first_actor, actor, side="right")) - 1
    if state.scenario_step[trigger] != AHEAD:
        return False
    state.scenario_step[trigger] = DONE
    return True


def _padded(poses: list[Pose], count: int) -> NDArray[np.float64]:
    """The poses, with NaN for actors that find no place: the route ends before it."""
    rows = np.full((count, 4), math.nan)
    rows[: len(poses)] = np.array(poses, np.float64).reshape(-1, 4)
    return rows


def _row(town: Town, plan: RoutePlan, trigger: ScenarioTrigger) -> _Row:
    row = _Row(type=trigger.type, point=trigger.point)
    if trigger.type == 1:
        _lay_debris(plan, row)
    elif trigger.type == 3:
        _hide_somebody(town, plan, row)
    elif trigger.type == 4:
        _place_cyclist(town, plan, row)
    elif trigger.type in ARMS_BY_DEFAULT:
        _choose_lights(town, plan, row, _arms(trigger))
    return row


def _lay_debris(plan: RoutePlan, row: _Row) -> None:
    here = float(plan.route_m[row.point])
    for distance in DEBRIS_AT_M:
        if here + distance <= plan.length_m:
            at = point_after(plan, row.point, distance, plan.lane.size)
            row.poses.append(road_pose(plan, at))
    row.end_m = here + DEBRIS_END_M


def _hide_somebody(town: Town, plan: RoutePlan, row: _Row) -> None:
    """Somebody beside the road a little ahead, on this side of a junction, and a machine."""
    kerb = find_kerb(town, int(plan.lane[row.point]), float(plan.lane_m[row.point]))
    junction, _ = next_junction(town, plan, row.point)
    ahead = CROSSER_AHEAD_M + AHEAD_PER_LANE_M * (kerb.lanes + kerb.parking)
    within = plan.lane.size if junction == row.point else junction
    at = point_after(plan, row.point, ahead, within)
    there = find_kerb(town, int(plan.lane[at]), float(plan.lane_m[at]))
    pose = beside_road(town, there)
    count = kerb.lanes + 2  # as CARLA counts lanes here: one's own and the sidewalk too
    row.speed_mps = 3.0 + 0.4 * count
    row.begin_m = float(plan.route_m[at]) - CROSSER_STARTS_M - count
    row.crossing_m = crossing_length(town, pose)
    beyond_edge = there.offset_m + there.width_m - there.edge_m
    row.poses = [pose, _machine(plan, row.point, pose, beyond_edge)]


def _machine(plan: RoutePlan, point: int, pose: Pose, beyond_edge_m: float) -> Pose:
    """A vending machine before somebody, on the line to him from the trigger, beside the road.

    He himself stands `beyond_edge_m` from the last driving lane.
    """
    x, y, z, yaw = pose
    road_yaw = yaw + 0.5 * math.pi
    cos, sin = math.cos(road_yaw), math.sin(road_yaw)
    dx, dy = x - float(plan.points[point, 0]), y - float(plan.points[point, 1])
    before = max((1.0 - HIDDEN_SHARE) * (dx * cos + dy * sin), HIDDEN_BEFORE_M)
    inwards = (1.0 - HIDDEN_SHARE) * (dy * cos - dx * sin)
    inwards = min(inwards, beyond_edge_m - MACHINE_HALF_LENGTH_M - MACHINE_ROOM_M)
    return (
        x - before * cos + inwards * sin,
        y - before * sin - inwards * cos,
        z,
        float(wrap_angle(yaw + math.pi)),
    )


def _place_cyclist(town: Town, plan: RoutePlan, row: _Row) -> None:
    """A cyclist beside the road behind the next junction; none where the route has none."""
    _, end = next_junction(town, plan, row.point)
    if end >= plan.lane.size:
        return
    again, _ = next_junction(town, plan, end)
    at = point_after(plan, end, CYCLIST_AFTER_M, again)
    kerb = find_kerb(town, int(plan.lane[at]), float(plan.lane_m[at]))
    count = kerb.lanes + 1 + kerb.parking
    at = point_after(plan, at, float(count), again)
    kerb = find_kerb(town, int(plan.lane[at]), float(plan.lane_m[at]))
    pose = beside_road(town, kerb)
    width = lane_width(town, plan, row.point)
    travel = width * (1.0 + 1.1 * count)
    row.speed_mps = CYCLIST_MPS
    row.begin_m = float(plan.route_m[at]) - CYCLIST_STARTS_M - travel
    row.crossing_m = max(crossing_length(town, pose), travel)
    row.poses = [pose]


def _arms(trigger: ScenarioTrigger) -> tuple[str, ...]:
    if not trigger.subtype:
        return ARMS_BY_DEFAULT[trigger.type]
    if trigger.subtype not in ARMS:
        near = difflib.get_close_matches(trigger.subtype, ARMS, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(ARMS)}."
        raise ValueError(f"there is no scenario '{trigger.subtype}' with lights; {hint}")
    return ARMS[trigger.subtype]


def _choose_lights(town: Town, plan: RoutePlan, row: _Row, arms: tuple[str, ...]) -> None:
    """The ego's next light and that of the other arm; without both nothing happens."""
    begin, end = next_junction(town, plan, row.point)
    signal = light_ahead(town, plan, begin)
    other = other_light(town, signal, arms) if signal >= 0 else -1
    if other < 0:
        return
    x, y, z, _ = road_pose(plan, begin)
    row.signal, row.other_signal, row.stop = signal, other, (x, y, z)
    row.junction = int(town.signals.junction[signal])
    row.red_ticks = round((RED_S + RED_S_PER_M * lights_apart_m(town, signal, other)) / TICK_S)
    row.end_m = float(plan.route_m[end]) if end < plan.lane.size else plan.length_m
