"""What ends a route in Leaderboard 1.0: completion, deviation, being blocked, the timeout."""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel
from di_envs.world.bodies import EgoNow
from di_envs.world.events.progress import route_completed
from di_envs.world.state import TICK_S, EventKind, Routes, State

WINDOW = 5  # route points looked at beyond the nearest so far
DEVIATION_M = 30.0  # from the nearest of them, at which the route ends at once
SAFE_M = 15.0  # from it, beyond which progress counts as deviation
DEVIATION_SHARE = 0.30  # of the route's length that may be passed that way
BLOCKED_BELOW_MPS = 0.1
BLOCKED_TICKS = round(180.0 / TICK_S)  # that may pass below that speed

COMPLETED, DEVIATED = int(EventKind.COMPLETED), int(EventKind.ROUTE_DEVIATION)
BLOCKED, TIMEOUT = int(EventKind.BLOCKED), int(EventKind.TIMEOUT)


@kernel
def _nearest_ahead(points: Float64, begin: int, end: int, x: float, y: float) -> tuple[int, float]:
    """The nearest of points (R, 4) [begin, end), the later of equals, and its distance [m]."""
    nearest, least = begin, math.inf
    for point in range(begin, end):
        dx, dy = x - points[point, 0], y - points[point, 1]
        square = dx * dx + dy * dy
        if square <= least:
            nearest, least = point, square
    return nearest, math.sqrt(least)


@kernel
def has_deviated(state: State, routes: Routes, now: EgoNow) -> bool:
    """Follows the nearest route point; true over 30 m away, or after too long over 15 m away."""
    first, end = routes.start[now.ego], routes.start[now.ego + 1]
    at = first + state.deviation_index[now.ego]
    nearest, distance = _nearest_ahead(routes.points, at, min(at + WINDOW + 1, end), now.x, now.y)
    if distance >= SAFE_M:
        state.deviation_m[now.ego] += routes.route_m[nearest] - routes.route_m[at]
    state.deviation_index[now.ego] = nearest - first
    allowed_m = DEVIATION_SHARE * routes.route_m[end - 1]
    return distance >= DEVIATION_M or state.deviation_m[now.ego] > allowed_m


@kernel
def is_blocked(state: State, now: EgoNow) -> bool:
    """Counts the ticks that the ego has stood; true after more than 180 s."""
    standing = now.speed < BLOCKED_BELOW_MPS
    ticks = state.blocked_ticks[now.ego] + 1 if standing else 0
    state.blocked_ticks[now.ego] = ticks
    return ticks > BLOCKED_TICKS


@kernel
def find_route_end(state: State, routes: Routes, now: EgoNow) -> int:
    """The EventKind that ends the route in this tick, 0 while it goes on.

    Of several at once, completion comes first, then deviation, blocked, timeout. A completed route
    is done in full.

    Args:
        state: The world; what it remembers for the ends of routes changes.
        routes: The egos' routes.
        now: The ego now (`EgoNow`).
    """
    deviated = has_deviated(state, routes, now)
    blocked = is_blocked(state, now)
    done_m = state.route_done_m[now.ego]
    if route_completed(routes, now.ego, done_m, now.x, now.y, now.z):
        state.route_done_m[now.ego] = routes.route_m[routes.start[now.ego + 1] - 1]
        return COMPLETED
    if deviated:
        return DEVIATED
    if blocked:
        return BLOCKED
    return TIMEOUT if now.tick * TICK_S > routes.timeout_s[now.ego] else 0
