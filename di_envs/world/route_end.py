# mypy: disallow_untyped_defs=False
"""What ends a route in Leaderboard 1.0: completion, deviation, being blocked, the timeout."""

from __future__ import annotations

import math

from di_envs.kernels import kernel
from di_envs.world.event_rows import record
from di_envs.world.lane_keeping import report_outside_lanes
from di_envs.world.progress import route_completed
from di_envs.world.state import TICK_S, EventKind

WINDOW = 5  # route points looked at beyond the nearest so far
DEVIATION_M = 30.0  # from the nearest of them, at which the route ends at once
SAFE_M = 15.0  # from it, beyond which progress counts as deviation
DEVIATION_SHARE = 0.30  # of the route's length that may be passed that way
BLOCKED_BELOW_MPS = 0.1
BLOCKED_TICKS = round(180.0 / TICK_S)  # that may pass below that speed

COMPLETED, DEVIATED = int(EventKind.COMPLETED), int(EventKind.ROUTE_DEVIATION)
BLOCKED, TIMEOUT = int(EventKind.BLOCKED), int(EventKind.TIMEOUT)


@kernel
def _nearest_ahead(state, routes, ego):
    """The nearest of the next route points (the later of equals) and its distance [m]."""
    first = routes.start[ego]
    now = first + state.deviation_index[ego]
    nearest, least = now, math.inf
    for point in range(now, min(now + WINDOW + 1, routes.start[ego + 1])):
        dx, dy = state.x[ego] - routes.points[point, 0], state.y[ego] - routes.points[point, 1]
        square = dx * dx + dy * dy
        if square <= least:
            nearest, least = point, square
    return nearest - first, math.sqrt(least)


@kernel
def has_deviated(state, routes, ego):
    """Follows the nearest route point; true over 30 m away, or after too long over 15 m away."""
    first = routes.start[ego]
    nearest, distance = _nearest_ahead(state, routes, ego)
    if distance >= SAFE_M:
        before = routes.route_m[first + state.deviation_index[ego]]
        state.deviation_m[ego] += routes.route_m[first + nearest] - before
    state.deviation_index[ego] = nearest
    length_m = routes.route_m[routes.start[ego + 1] - 1]
    return distance >= DEVIATION_M or state.deviation_m[ego] > DEVIATION_SHARE * length_m


@kernel
def _is_blocked(state, ego):
    if state.speed[ego] < BLOCKED_BELOW_MPS:
        state.blocked_ticks[ego] += 1
    else:
        state.blocked_ticks[ego] = 0
    return state.blocked_ticks[ego] > BLOCKED_TICKS


@kernel
def close_route(state, ego, out, n):
    """Reports the metres outside lanes; for routes that end from outside, as by a failed agent."""
    return report_outside_lanes(state, ego, out, n)


@kernel
def detect_route_end(state, routes, ego, out, n):
    """Records what ends the route in this tick, at most one event; returns the rows in use.

    Of several at once, completion comes first, then deviation, blocked, timeout.
    """
    deviated = has_deviated(state, routes, ego)
    blocked = _is_blocked(state, ego)
    if route_completed(state, routes, ego):
        reason = COMPLETED
        state.route_done_m[ego] = routes.route_m[routes.start[ego + 1] - 1]
    elif deviated:
        reason = DEVIATED
    elif blocked:
        reason = BLOCKED
    elif state.tick[()] * TICK_S > routes.timeout_s[ego]:
        reason = TIMEOUT
    else:
        return n
    n = close_route(state, ego, out, n)
    state.finished[ego] = reason
    x, y, z = state.x[ego], state.y[ego], state.z[ego]
    return record(state, out, n, reason, ego, x, y, z, -1, 0.0)
