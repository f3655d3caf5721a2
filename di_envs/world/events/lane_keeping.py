"""Driving outside lanes or against them, by Leaderboard 1.0: metres now, one event at the end."""

from __future__ import annotations

import math

from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import LaneKind, Lanes
from di_envs.town.queries import nearest_lane, pose_at, width_at
from di_envs.world.bodies import EgoNow
from di_envs.world.events.progress import is_past
from di_envs.world.state import Routes, State

ALLOWED_OUT_M = 1.3  # beyond the lane's edge, for the ego's centre
AGAINST_LANE = math.cos(math.radians(120.0))  # leaving a junction this far off the lane's direction
LANE_JUMP = math.cos(math.radians(150.0))  # between two ticks' lanes: into or out of the wrong one
WINDOW = 3  # route points looked at beyond the present one
PARKING_LOOK_M = 10.0  # for a parking lane; further away none can help
PARKING_MASK = 1 << int(LaneKind.PARKING)


@kernel
def is_outside_lanes(lanes: Lanes, now: EgoNow) -> bool:
    """Whether the ego's centre is over 1.3 m beyond the nearest driving or parking lane."""
    width, distance = 0.0, math.inf
    if now.lane >= 0:
        width = width_at(lanes, now.lane, now.lane_m)
        x, y, z, _yaw = pose_at(lanes, now.lane, now.lane_m)
        distance = math.sqrt((x - now.x) ** 2 + (y - now.y) ** 2 + (z - now.z) ** 2)
    if distance <= 0.5 * width:  # on its lane: no parking lane could make that an infraction
        return False
    parking, at, _lateral, away = nearest_lane(
        lanes, now.x, now.y, now.z, PARKING_LOOK_M, as_int64(PARKING_MASK)
    )
    if parking >= 0 and away <= distance:
        distance, width = away, width_at(lanes, parking, at)
    return distance > 0.5 * width + ALLOWED_OUT_M


@kernel
def _is_wrong_lane(
    lanes: Lanes, now: EgoNow, lane_yaw: float, before: int, before_yaw: float, wrong: bool
) -> bool:
    """Whether the ego is on a lane against its direction; looked at only when the lane changes."""
    lane = now.lane
    if lanes.junction[lane] >= 0:  # lanes are too tangled there
        return False
    if before < 0:
        return wrong
    if lanes.road[lane] == lanes.road[before] and lanes.lane_id[lane] == lanes.lane_id[before]:
        return wrong
    if lanes.junction[before] >= 0:
        return math.cos(lane_yaw - now.yaw) <= AGAINST_LANE
    # a change between lanes of one direction clears it, whatever it was
    return math.cos(lane_yaw - before_yaw) <= LANE_JUMP and not wrong


@kernel
def watch_lanes(state: State, lanes: Lanes, routes: Routes, now: EgoNow, lane_yaw: float) -> None:
    """Updates the ego's lane flags, and counts the route metres passed while one is up.

    Args:
        state: The world; the ego's lane flags and metres change.
        lanes: The town's lanes.
        routes: The egos' routes.
        now: The ego now (`EgoNow`).
        lane_yaw: Direction of its lane there [rad].
    """
    e = now.ego
    wrong = state.wrong_lane[e] != 0
    if now.lane >= 0:
        before, before_yaw = state.lane_before[e], state.lane_before_yaw[e]
        wrong = _is_wrong_lane(lanes, now, lane_yaw, before, before_yaw, wrong)
        state.lane_before[e], state.lane_before_yaw[e] = now.lane, lane_yaw
    outside = is_outside_lanes(lanes, now)
    state.wrong_lane[e] = 1 if wrong else 0
    state.outside_lane[e] = 1 if outside else 0

    first, end = routes.start[e], routes.start[e + 1]
    at = first + state.outside_index[e]
    for point in range(at + 1, min(at + WINDOW + 1, end)):
        if is_past(routes.points, point, now.x, now.y):
            done = routes.route_m[point] - routes.route_m[first + state.outside_index[e]]
            state.outside_index[e] = point - first
            state.outside_done_m[e] += done
            if wrong or outside:
                state.outside_m[e] += done
