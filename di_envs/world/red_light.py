# mypy: disallow_untyped_defs=False
"""Running a red light, by Leaderboard 1.0: the fine comes when the tail crosses the stop line."""

from __future__ import annotations

import math

from di_envs.kernels import kernel
from di_envs.town.lanes import LightState, SignalKind
from di_envs.town.queries import DRIVING_MASK, nearest_lane
from di_envs.world.event_rows import record
from di_envs.world.state import EventKind

WITHIN_M = 15.0  # of the ego the centre of the light's trigger box must be
TAIL_FROM = 0.8  # half lengths behind the centre at which the tail begins …
TAIL_BEYOND_M = 1.0  # … and metres behind the bumper at which it ends
LINE_HALF_WIDTHS = 0.4  # of the lane's width, to either side: yes, less than the lane
TAIL_LOOK_M = 10.0  # for the lane below the tail

LIGHT, RED = int(SignalKind.LIGHT), int(LightState.RED)
RED_LIGHT = int(EventKind.RED_LIGHT)


@kernel
def _side(ax, ay, bx, by, px, py):
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)


@kernel
def segments_cross(ax, ay, bx, by, cx, cy, dx, dy):
    """Whether the segments ab and cd meet; touching counts, lying on one line does not."""
    c_side, d_side = _side(ax, ay, bx, by, cx, cy), _side(ax, ay, bx, by, dx, dy)
    a_side, b_side = _side(cx, cy, dx, dy, ax, ay), _side(cx, cy, dx, dy, bx, by)
    if c_side == 0.0 and d_side == 0.0:
        return False
    return c_side * d_side <= 0.0 and a_side * b_side <= 0.0


@kernel
def _watched(state, signals, ego, signal):
    """Whether this light can fine the ego now: red, near, and not the last that did."""
    if signals.kind[signal] != LIGHT or state.light[signal] != RED:
        return False
    dx = signals.box[signal, 0] - state.x[ego]
    dy = signals.box[signal, 1] - state.y[ego]
    dz = signals.box[signal, 2] - state.z[ego]
    near = dx * dx + dy * dy + dz * dz <= WITHIN_M * WITHIN_M
    return near and signal != state.last_red_signal[ego]


@kernel
def _tail_crosses(state, lanes, signals, ego, line):
    """Whether the ego's tail lies across a stop line, on its lane and in its direction."""
    cos, sin = math.cos(state.yaw[ego]), math.sin(state.yaw[ego])
    near = TAIL_FROM * state.half_length[ego]
    far = state.half_length[ego] + TAIL_BEYOND_M
    near_x, near_y = state.x[ego] - near * cos, state.y[ego] - near * sin
    far_x, far_y = state.x[ego] - far * cos, state.y[ego] - far * sin

    yaw = signals.stop_pose[line, 3]
    if cos * math.cos(yaw) + sin * math.sin(yaw) <= 0.0:
        return False
    reach = LINE_HALF_WIDTHS * signals.stop_width_m[line]
    side_x, side_y = -math.sin(yaw) * reach, math.cos(yaw) * reach
    x, y = signals.stop_pose[line, 0], signals.stop_pose[line, 1]
    if not segments_cross(
        near_x, near_y, far_x, far_y, x - side_x, y - side_y, x + side_x, y + side_y
    ):
        return False
    tail = nearest_lane(lanes, far_x, far_y, state.z[ego], TAIL_LOOK_M, DRIVING_MASK)[0]
    stop = signals.stop_lane[line]
    same_road = tail >= 0 and lanes.road[tail] == lanes.road[stop]
    return same_road and lanes.lane_id[tail] == lanes.lane_id[stop]


@kernel
def detect_red_light(state, lanes, signals, ego, out, n):
    """Records the red lights that the ego's tail is crossing; returns the rows in use."""
    for signal in range(signals.kind.shape[0]):
        if not _watched(state, signals, ego, signal):
            continue
        for line in range(signals.stop_signal.shape[0]):
            if signals.stop_signal[line] == signal and _tail_crosses(
                state, lanes, signals, ego, line
            ):
                x, y, z = signals.pose[signal, 0], signals.pose[signal, 1], signals.pose[signal, 2]
                n = record(state, out, n, RED_LIGHT, ego, x, y, z, signal, 0.0)
                state.last_red_signal[ego] = signal
                break
    return n
