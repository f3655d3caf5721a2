"""Running a stop sign, by Leaderboard 1.0, with its traps.

A sign is watched once its trigger box lies on the lane ahead. The fine comes when the box is no
longer ahead, the ego never stood, and its centre had been in a box of the same size around the
*sign* (not around its trigger): a sign that stands far from its lane never fines.

Two things are ours. A box is turned as its street is; CARLA's are parallel to the world's axes,
which is the same for streets along them and otherwise reaches over other lanes. And a sign is for
those whose lane it rules, or leads to one that it rules within the box: CARLA's boxes are drawn by
hand so that they lie on no other lane, ours are not.
"""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Float64
from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, SignalKind, Signals
from di_envs.town.queries import pose_at
from di_envs.world.bodies import SAME_LEVEL_M, EgoNow
from di_envs.world.events.rows import record
from di_envs.world.state import EventKind, State

NEAR_M = 50.0  # from the sign, beyond which it is not looked at
STEPS_AHEAD = 20  # lane points of one metre's step that are looked at
STEP_M = 1.0
LANE_LOOK_M = 40.0  # at most, from an ego to its lane
STOOD_BELOW_MPS = 0.1

STOP, STOP_SIGN = int(SignalKind.STOP), int(EventKind.STOP_SIGN)


@kernel
def _inside(x: float, y: float, z: float, centre: Float64, box: Float64) -> bool:
    """Whether a point is in a box like a sign's trigger box, around another centre.

    Args:
        x, y, z: The point [m].
        centre: (N,) x, y, z, … of the middle.
        box: (6,) the trigger box, as of `Signals`, for its direction and half sides.
    """
    dx, dy = x - centre[0], y - centre[1]
    cos, sin = math.cos(box[3]), math.sin(box[3])
    ahead, right = cos * dx + sin * dy, cos * dy - sin * dx
    beside = abs(ahead) < box[4] and abs(right) < box[5]
    return beside and abs(z - centre[2]) < SAME_LEVEL_M


@kernel
def _may_be_ahead(now: EgoNow, pole: Float64, box: Float64) -> bool:
    """Necessary conditions for a sign's box to lie on the lane ahead, quick to check.

    Args:
        now: The ego now.
        pole: (4,) x, y, z, yaw of the sign's foot.
        box: (6,) its trigger box, as of `Signals`.
    """
    dx, dy, dz = pole[0] - now.x, pole[1] - now.y, pole[2] - now.z
    if dx * dx + dy * dy + dz * dz > NEAR_M * NEAR_M:
        return False
    # the lane's points start at most the look's width from the ego and reach 20 m
    reach = STEPS_AHEAD * STEP_M + LANE_LOOK_M + box[4] + box[5]
    return math.hypot(box[0] - now.x, box[1] - now.y) < reach


@kernel
def _rules_lane(lanes: Lanes, signals: Signals, lane: int, sign: int) -> bool:
    """Whether the stop line at a lane's end is the sign's."""
    line = lanes.stop_line[lane]
    return line >= 0 and signals.stop_signal[line] == sign


@kernel
def is_ahead(lanes: Lanes, signals: Signals, now: EgoNow, sign: int) -> bool:
    """Whether the ego is on its way through a sign's trigger box, over a lane that the sign rules.

    Looked at are the ego and the next 20 m of its lane, first links onwards. The lane that the sign
    rules may be shorter than the box or than a step: then the box begins on the lanes before it.
    """
    box = signals.box[sign]
    if now.lane < 0 or not _may_be_ahead(now, signals.pose[sign], box):
        return False
    lane, station = now.lane, now.lane_m
    met = _inside(now.x, now.y, now.z, box, box)
    ruled = _rules_lane(lanes, signals, lane, sign)
    for _ in range(STEPS_AHEAD):
        if met and ruled:
            return True
        station += STEP_M
        while station > lanes.length_m[lane]:
            link = lanes.successor_start[lane]
            if link == lanes.successor_start[lane + 1]:
                return False
            station -= lanes.length_m[lane]
            lane = lanes.successor[link]
            ruled = ruled or _rules_lane(lanes, signals, lane, sign)
        x, y, z, _yaw = pose_at(lanes, lane, station)
        met = met or _inside(x, y, z, box, box)
    return met and ruled


@kernel
def _find_sign(lanes: Lanes, signals: Signals, now: EgoNow, lane_yaw: float) -> int:
    """The first stop sign ahead, -1 where there is none or the ego heads against its lane."""
    if now.lane < 0 or math.cos(lane_yaw - now.yaw) <= 0.0:
        return -1
    for sign in range(signals.kind.size):
        if signals.kind[sign] == STOP and is_ahead(lanes, signals, now, sign):
            return sign
    return -1


@kernel
def detect_stop_sign(
    state: State, lanes: Lanes, signals: Signals, now: EgoNow, lane_yaw: float, out: Float64, n: int
) -> int:
    """Follows the stop sign ahead and records it when it was run.

    Args:
        state: The world; `stop_target`, `stop_done` and `stop_affected` change.
        lanes: The town's lanes.
        signals: The town's signals.
        now: The ego now (`EgoNow`).
        lane_yaw: Direction of its lane there [rad].
        out: (N, 8) event rows.
        n: Rows in use.

    Returns:
        The number of rows in use.
    """
    sign = as_int64(state.stop_target[now.ego])
    if sign < 0:
        state.stop_target[now.ego] = _find_sign(lanes, signals, now, lane_yaw)
        return n
    if now.speed < STOOD_BELOW_MPS:
        state.stop_done[now.ego] = 1
    pole = signals.pose[sign]
    if _inside(now.x, now.y, now.z, pole, signals.box[sign]):
        state.stop_affected[now.ego] = 1
    if is_ahead(lanes, signals, now, sign):
        return n
    if state.stop_done[now.ego] == 0 and state.stop_affected[now.ego] == 1:
        n = record(out, n, STOP_SIGN, now.ego, now.tick, pole[0], pole[1], pole[2], sign, 0.0)
    state.stop_target[now.ego] = -1
    state.stop_done[now.ego] = 0
    state.stop_affected[now.ego] = 0
    return n
