"""Running a red light, by Leaderboard 1.0: the fine comes when the tail crosses the stop line."""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Float64
from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, LightState, SignalKind, Signals
from di_envs.town.queries import DRIVING_MASK, nearest_lane
from di_envs.world.bodies import EgoNow
from di_envs.world.events.rows import record
from di_envs.world.state import EventKind, State

WITHIN_M = 15.0  # of the ego the centre of the light's trigger box must be
TAIL_FROM = 0.8  # half lengths behind the centre at which the tail begins …
TAIL_BEYOND_M = 1.0  # … and metres behind the bumper at which it ends
LINE_HALF_WIDTHS = 0.4  # of the lane's width, to either side: yes, less than the lane
TAIL_LOOK_M = 10.0  # for the lane below the tail

LIGHT, RED = int(SignalKind.LIGHT), int(LightState.RED)
RED_LIGHT = int(EventKind.RED_LIGHT)


@kernel
def _side(ax: float, ay: float, bx: float, by: float, px: float, py: float) -> float:
    """On which side of the line ab the point p lies: positive, negative, or 0 for on it."""
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)


@kernel
def segments_cross(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> bool:
    """Whether the segments ab and cd meet; touching counts, lying on one line does not."""
    c_side, d_side = _side(ax, ay, bx, by, cx, cy), _side(ax, ay, bx, by, dx, dy)
    a_side, b_side = _side(cx, cy, dx, dy, ax, ay), _side(cx, cy, dx, dy, bx, by)
    if c_side == 0.0 and d_side == 0.0:
        return False
    return c_side * d_side <= 0.0 and a_side * b_side <= 0.0


@kernel
def _is_near(signals: Signals, signal: int, now: EgoNow) -> bool:
    """Whether the centre of the signal's trigger box is within 15 m of the ego."""
    dx = signals.box[signal, 0] - now.x
    dy = signals.box[signal, 1] - now.y
    dz = signals.box[signal, 2] - now.z
    return dx * dx + dy * dy + dz * dz <= WITHIN_M * WITHIN_M


@kernel
def tail_crosses(now: EgoNow, x: float, y: float, yaw: float, width_m: float) -> bool:
    """Whether the ego's tail lies across the stop line at a pose, in the direction of its lane."""
    cos, sin = math.cos(now.yaw), math.sin(now.yaw)
    line_cos, line_sin = math.cos(yaw), math.sin(yaw)
    if cos * line_cos + sin * line_sin <= 0.0:
        return False
    near, far = TAIL_FROM * now.half_length, now.half_length + TAIL_BEYOND_M
    side_x, side_y = -line_sin * LINE_HALF_WIDTHS * width_m, line_cos * LINE_HALF_WIDTHS * width_m
    return segments_cross(
        now.x - near * cos,
        now.y - near * sin,
        now.x - far * cos,
        now.y - far * sin,
        x - side_x,
        y - side_y,
        x + side_x,
        y + side_y,
    )


@kernel
def _tail_is_on(lanes: Lanes, now: EgoNow, stop: int) -> bool:
    """Whether the far end of the tail is on the road and lane of the stop line."""
    far = now.half_length + TAIL_BEYOND_M
    x, y = now.x - far * math.cos(now.yaw), now.y - far * math.sin(now.yaw)
    tail = nearest_lane(lanes, x, y, now.z, TAIL_LOOK_M, as_int64(DRIVING_MASK))[0]
    same_road = tail >= 0 and lanes.road[tail] == lanes.road[stop]
    return same_road and lanes.lane_id[tail] == lanes.lane_id[stop]


@kernel
def detect_red_light(
    state: State, lanes: Lanes, signals: Signals, now: EgoNow, out: Float64, n: int
) -> int:
    """Records the red lights that the ego's tail is crossing.

    Args:
        state: The world; `last_red_signal` changes.
        lanes: The town's lanes.
        signals: The town's signals.
        now: The ego now (`EgoNow`).
        out: (N, 8) event rows.
        n: Rows in use.

    Returns:
        The number of rows in use.
    """
    for signal in range(signals.kind.size):
        if state.light[signal] != RED or signals.kind[signal] != LIGHT:
            continue
        if signal == state.last_red_signal[now.ego]:
            continue
        if not _is_near(signals, signal, now):
            continue
        for line in range(signals.stop_signal.size):
            if signals.stop_signal[line] != signal:
                continue
            pose = signals.stop_pose[line]
            crosses = tail_crosses(now, pose[0], pose[1], pose[3], signals.stop_width_m[line])
            if crosses and _tail_is_on(lanes, now, signals.stop_lane[line]):
                pole = signals.pose[signal]
                n = record(
                    out, n, RED_LIGHT, now.ego, now.tick, pole[0], pole[1], pole[2], signal, 0.0
                )
                state.last_red_signal[now.ego] = signal
                break
    return n
