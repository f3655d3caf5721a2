# mypy: disallow_untyped_defs=False
"""Running a stop sign, by Leaderboard 1.0, with its traps.

A sign is watched once its trigger box lies on the lane ahead. The fine comes when the box is no
longer ahead, the ego never stood, and its centre had been in a box of the same size around the
*sign* (not around its trigger): a sign that stands far from its lane never fines.

Boxes are parallel to the world's axes. Where a trigger box is turned, we take the box around it;
CARLA's rule leaves its sides unturned, which is the same up to their order for streets along the
axes.
"""

from __future__ import annotations

import math

from di_envs.kernels import kernel
from di_envs.town.lanes import SignalKind
from di_envs.town.queries import pose_at
from di_envs.world.event_rows import record
from di_envs.world.state import EventKind

NEAR_M = 50.0  # from the sign, beyond which it is not looked at
STEPS_AHEAD = 20  # lane points of one metre's step that are looked at
STEP_M = 1.0
STOOD_BELOW_MPS = 0.1
SAME_LEVEL_M = 3.0

STOP, STOP_SIGN = int(SignalKind.STOP), int(EventKind.STOP_SIGN)


@kernel
def _box_extent(signals, sign):
    """Half sides along x and y [m] of the axis-parallel box around the trigger box."""
    cos, sin = abs(math.cos(signals.box[sign, 3])), abs(math.sin(signals.box[sign, 3]))
    half_length, half_width = signals.box[sign, 4], signals.box[sign, 5]
    return half_length * cos + half_width * sin, half_length * sin + half_width * cos


@kernel
def _inside(x, y, z, centre, extent_x, extent_y):
    """Whether a point lies in the box around `centre` (x, y, z, …), at its level."""
    beside = abs(x - centre[0]) < extent_x and abs(y - centre[1]) < extent_y
    return beside and abs(z - centre[2]) < SAME_LEVEL_M


@kernel
def _is_near(state, signals, ego, sign, extent_x, extent_y):
    """Cheap necessary conditions for the box to lie on the lane ahead."""
    x, y, z = state.x[ego], state.y[ego], state.z[ego]
    dx, dy, dz = signals.pose[sign, 0] - x, signals.pose[sign, 1] - y, signals.pose[sign, 2] - z
    if dx * dx + dy * dy + dz * dz > NEAR_M * NEAR_M:
        return False
    reach = STEPS_AHEAD * STEP_M + abs(state.lateral_m[ego]) + extent_x + extent_y + 1.0
    return math.hypot(signals.box[sign, 0] - x, signals.box[sign, 1] - y) < reach


@kernel
def is_ahead(state, lanes, signals, ego, sign):
    """Whether the ego, or one of the next 20 m of its lane, is in the sign's trigger box."""
    extent_x, extent_y = _box_extent(signals, sign)
    if not _is_near(state, signals, ego, sign, extent_x, extent_y):
        return False
    box = signals.box[sign]
    if _inside(state.x[ego], state.y[ego], state.z[ego], box, extent_x, extent_y):
        return True
    lane, station = state.lane[ego], state.lane_m[ego]
    for _ in range(STEPS_AHEAD):
        if lane < 0:
            return False
        station += STEP_M
        if station > lanes.length_m[lane]:
            station -= lanes.length_m[lane]
            link = lanes.successor_start[lane]
            lane = lanes.successor[link] if link < lanes.successor_start[lane + 1] else -1
            if lane < 0:
                return False
        x, y, z, _yaw = pose_at(lanes, lane, station)
        if _inside(x, y, z, box, extent_x, extent_y):
            return True
    return False


@kernel
def _find_sign(state, lanes, signals, ego):
    """The first stop sign ahead, -1 where there is none or the ego heads against its lane."""
    lane = state.lane[ego]
    if lane < 0:
        return -1
    yaw = pose_at(lanes, lane, state.lane_m[ego])[3]
    if math.cos(yaw - state.yaw[ego]) <= 0.0:
        return -1
    for sign in range(signals.kind.shape[0]):
        if signals.kind[sign] == STOP and is_ahead(state, lanes, signals, ego, sign):
            return sign
    return -1


@kernel
def detect_stop_sign(state, lanes, signals, ego, out, n):
    """Follows the stop sign ahead and records it when it was run; returns the rows in use."""
    sign = state.stop_target[ego]
    if sign < 0:
        state.stop_target[ego] = _find_sign(state, lanes, signals, ego)
        return n
    if state.speed[ego] < STOOD_BELOW_MPS:
        state.stop_done[ego] = 1
    pose = signals.pose[sign]
    extent_x, extent_y = _box_extent(signals, sign)
    if _inside(state.x[ego], state.y[ego], state.z[ego], pose, extent_x, extent_y):
        state.stop_affected[ego] = 1
    if is_ahead(state, lanes, signals, ego, sign):
        return n
    if state.stop_done[ego] == 0 and state.stop_affected[ego] == 1:
        n = record(state, out, n, STOP_SIGN, ego, pose[0], pose[1], pose[2], sign, 0.0)
    state.stop_target[ego] = -1
    state.stop_done[ego] = 0
    state.stop_affected[ego] = 0
    return n
