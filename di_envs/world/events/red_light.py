"""Running a red light: the fine comes when the tail crosses the stop line, as in Leaderboard 1.0.

Its line is 0.8 lane widths long, so whoever crosses at the edge of the lane goes free. Beside it
the line is watched as wide as the lane, and on to where the ego would be outside the lanes: that is
the one by which `di-1.0` goes.
"""

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
BESIDE_LANE_M = 1.3  # that the wide line goes on beyond the lane: further out, metres outside count
TAIL_LOOK_M = 10.0  # for the lane below the tail

LIGHT, RED = int(SignalKind.LIGHT), int(LightState.RED)
RED_LIGHT, RED_LIGHT_WIDE = int(EventKind.RED_LIGHT), int(EventKind.RED_LIGHT_WIDE)


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
def tail_crosses(now: EgoNow, x: float, y: float, yaw: float, half_m: float) -> bool:
    """Whether the ego's tail lies across the stop line at a pose, in the direction of its lane.

    Args:
        now: The ego now.
        x, y, yaw: The line's middle and its lane's direction, world frame.
        half_m: How far the line goes to either side.
    """
    cos, sin = math.cos(now.yaw), math.sin(now.yaw)
    line_cos, line_sin = math.cos(yaw), math.sin(yaw)
    if cos * line_cos + sin * line_sin <= 0.0:
        return False
    near, far = TAIL_FROM * now.half_length, now.half_length + TAIL_BEYOND_M
    side_x, side_y = -line_sin * half_m, line_cos * half_m
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
def _lane_below_tail(lanes: Lanes, now: EgoNow) -> int:
    """The driving lane below the far end of the tail, -1 for none."""
    far = now.half_length + TAIL_BEYOND_M
    x, y = now.x - far * math.cos(now.yaw), now.y - far * math.sin(now.yaw)
    return nearest_lane(lanes, x, y, now.z, TAIL_LOOK_M, as_int64(DRIVING_MASK))[0]


@kernel
def _is_same_lane(lanes: Lanes, a: int, b: int) -> bool:
    """Whether two lanes are pieces of one, by their road's and their own numbers."""
    return lanes.road[a] == lanes.road[b] and lanes.lane_id[a] == lanes.lane_id[b]


@kernel
def _is_ruled(lanes: Lanes, signals: Signals, signal: int, stop: int, tail: int) -> bool:
    """Whether a tail over a lane at a stop line of `signal` came past it, and by no other way.

    It did on a lane that the signal rules, or on the wrong side of the road, but not on a lane
    beside them that goes by another signal or by none.
    """
    if lanes.road[tail] != lanes.road[stop]:
        return False
    if lanes.lane_id[tail] * lanes.lane_id[stop] < 0:
        return True
    for line in range(signals.stop_signal.size):
        if signals.stop_signal[line] == signal:
            if _is_same_lane(lanes, tail, signals.stop_lane[line]):
                return True
    return False


@kernel
def _is_crossing(
    lanes: Lanes, signals: Signals, now: EgoNow, signal: int, tail: int, wide: bool
) -> bool:
    """Whether the tail crosses a stop line of a signal, by the wide line or by CARLA's.

    Args:
        lanes: The town's lanes.
        signals: The town's signals.
        now: The ego now.
        signal: Whose stop lines.
        tail: The lane below the tail's far end; -1 asks of the lines alone.
        wide: By which line.
    """
    for line in range(signals.stop_signal.size):
        if signals.stop_signal[line] != signal:
            continue
        pose, stop = signals.stop_pose[line], signals.stop_lane[line]
        width_m = signals.stop_width_m[line]
        half_m = 0.5 * width_m + BESIDE_LANE_M if wide else LINE_HALF_WIDTHS * width_m
        if not tail_crosses(now, pose[0], pose[1], pose[3], half_m):
            continue
        if tail < 0 or _is_same_lane(lanes, tail, stop):
            return True
        if wide and _is_ruled(lanes, signals, signal, stop, tail):
            return True
    return False


@kernel
def detect_red_light(
    state: State, lanes: Lanes, signals: Signals, now: EgoNow, out: Float64, n: int
) -> int:
    """Records the red lights that the ego's tail is crossing, by CARLA's line and by the wide one.

    Args:
        state: The world; `last_red_signal` and `last_wide_signal` change.
        lanes: The town's lanes.
        signals: The town's signals.
        now: The ego now (`EgoNow`).
        out: (N, 8) event rows.
        n: Rows in use.

    Returns:
        The number of rows in use. The light that was fined last is not fined again.
    """
    for signal in range(signals.kind.size):
        if state.light[signal] != RED or signals.kind[signal] != LIGHT:
            continue
        short = signal != state.last_red_signal[now.ego]
        wide = signal != state.last_wide_signal[now.ego]
        if not (short or wide) or not _is_near(signals, signal, now):
            continue
        if not _is_crossing(lanes, signals, now, signal, -1, True):
            continue
        tail = _lane_below_tail(lanes, now)
        if tail < 0:
            break
        pole, tick = signals.pose[signal], now.tick
        if short and _is_crossing(lanes, signals, now, signal, tail, False):
            n = record(out, n, RED_LIGHT, now.ego, tick, pole[0], pole[1], pole[2], signal, 0.0)
            state.last_red_signal[now.ego] = signal
        if wide and _is_crossing(lanes, signals, now, signal, tail, True):
            n = record(
                out, n, RED_LIGHT_WIDE, now.ego, tick, pole[0], pole[1], pole[2], signal, 0.0
            )
            state.last_wide_signal[now.ego] = signal
    return n
