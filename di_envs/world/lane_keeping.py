# mypy: disallow_untyped_defs=False
"""Driving outside lanes or against them, by Leaderboard 1.0: metres now, one event at the end."""

from __future__ import annotations

import math

from di_envs.kernels import kernel
from di_envs.town.lanes import LaneKind
from di_envs.town.queries import nearest_lane, pose_at, width_at
from di_envs.world.event_rows import record
from di_envs.world.progress import is_past
from di_envs.world.state import EventKind

ALLOWED_OUT_M = 1.3  # beyond the lane's edge, for the ego's centre
AGAINST_LANE = math.cos(math.radians(120.0))  # leaving a junction this far off the lane's direction
LANE_JUMP = math.cos(math.radians(150.0))  # between two ticks' lanes: into or out of the wrong one
WINDOW = 3  # route points looked at beyond the present one
PARKING_LOOK_M = 10.0  # for a parking lane; further away none can help
PARKING_MASK = 1 << int(LaneKind.PARKING)
OUTSIDE_LANES = int(EventKind.OUTSIDE_LANES)


@kernel
def _distance_to(state, lanes, ego, lane, station):
    x, y, z, _yaw = pose_at(lanes, lane, station)
    dx, dy, dz = x - state.x[ego], y - state.y[ego], z - state.z[ego]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@kernel
def is_outside_lanes(state, lanes, ego):
    """Whether the ego's centre is over 1.3 m beyond the nearest driving or parking lane."""
    lane, station = state.lane[ego], state.lane_m[ego]
    width, distance = 0.0, math.inf
    if lane >= 0:
        width = width_at(lanes, lane, station)
        distance = _distance_to(state, lanes, ego, lane, station)
    if distance <= 0.5 * width:  # on its lane: no parking lane could make that an infraction
        return False
    parking, at, _lateral, away = nearest_lane(
        lanes, state.x[ego], state.y[ego], state.z[ego], PARKING_LOOK_M, PARKING_MASK
    )
    if parking >= 0 and away <= distance:
        distance, width = away, width_at(lanes, parking, at)
    return distance > 0.5 * width + ALLOWED_OUT_M


@kernel
def _note_wrong_lane(state, lanes, ego):
    """Follows whether the ego is on a lane against its direction; looks only at lane changes."""
    lane, before = state.lane[ego], state.lane_before[ego]
    if lane < 0:
        return
    yaw = pose_at(lanes, lane, state.lane_m[ego])[3]
    if lanes.junction[lane] >= 0:  # lanes are too tangled there
        state.wrong_lane[ego] = 0
    elif before >= 0 and (
        lanes.road[lane] != lanes.road[before] or lanes.lane_id[lane] != lanes.lane_id[before]
    ):
        if lanes.junction[before] >= 0:
            against = math.cos(yaw - state.yaw[ego]) <= AGAINST_LANE
            state.wrong_lane[ego] = 1 if against else 0
        elif math.cos(yaw - state.lane_before_yaw[ego]) <= LANE_JUMP:
            state.wrong_lane[ego] = 1 - state.wrong_lane[ego]
        else:  # a change between lanes of one direction clears it, whatever it was
            state.wrong_lane[ego] = 0
    state.lane_before[ego] = lane
    state.lane_before_yaw[ego] = yaw


@kernel
def watch_lanes(state, lanes, routes, ego):
    """Updates the ego's lane flags, and counts the route metres passed while one is up."""
    state.outside_lane[ego] = 1 if is_outside_lanes(state, lanes, ego) else 0
    _note_wrong_lane(state, lanes, ego)
    wrong = state.outside_lane[ego] != 0 or state.wrong_lane[ego] != 0
    first, end = routes.start[ego], routes.start[ego + 1]
    now = first + state.outside_index[ego]
    for point in range(now + 1, min(now + WINDOW + 1, end)):
        if is_past(routes, point, state.x[ego], state.y[ego]):
            done = routes.route_m[point] - routes.route_m[first + state.outside_index[ego]]
            state.outside_index[ego] = point - first
            state.outside_done_m[ego] += done
            if wrong:
                state.outside_m[ego] += done


@kernel
def report_outside_lanes(state, ego, out, n):
    """Records the metres outside lanes, if there are any, at the route's end."""
    metres = state.outside_m[ego]
    if metres <= 0.0:
        return n
    x, y, z = state.x[ego], state.y[ego], state.z[ego]
    return record(state, out, n, OUTSIDE_LANES, ego, x, y, z, -1, metres)
