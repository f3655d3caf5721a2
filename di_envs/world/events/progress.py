"""How far along its route an ego has come, by Leaderboard 1.0's route completion test."""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel
from di_envs.world.state import Routes, State

WINDOW = 2  # route points looked at beyond the present one
DONE_SHARE = 0.99  # of the route's length, more than which must lie behind
DONE_WITHIN_M = 10.0  # of its last point


@kernel
def is_past(points: Float64, point: int, x: float, y: float) -> bool:
    """Whether a position lies ahead of one of the route points (R, 4), seen along the lane there.

    There is no limit to the side, so a route's lateral jumps (lane changes) and backward steps
    (where keypoints join) do no harm.
    """
    yaw = points[point, 3]
    dx, dy = x - points[point, 0], y - points[point, 1]
    return dx * math.cos(yaw) + dy * math.sin(yaw) > 0.0


@kernel
def advance_progress(state: State, routes: Routes, ego: int) -> None:
    """Moves an ego's route index, metres done and next target on; they never go back."""
    if state.finished[ego] != 0:
        return
    x, y, index, aim = state.x[ego], state.y[ego], state.route_index[ego], state.target_index[ego]
    first, end = routes.start[ego], routes.start[ego + 1]
    for point in range(first + index, min(first + index + WINDOW + 1, end)):
        if is_past(routes.points, point, x, y):
            index = point - first
            state.route_done_m[ego] = routes.route_m[point]
    targets = routes.target[routes.target_start[ego] : routes.target_start[ego + 1]]
    while aim + 1 < targets.size and targets[aim] <= index:
        aim += 1
    state.route_index[ego] = index
    state.target_index[ego] = aim


@kernel
def route_completed(routes: Routes, ego: int, done_m: float, x: float, y: float, z: float) -> bool:
    """Whether more than 99 % are done and the last point is less than 10 m from (x, y, z)."""
    last = routes.start[ego + 1] - 1
    if not done_m > DONE_SHARE * routes.route_m[last]:
        return False
    dx, dy, dz = x - routes.points[last, 0], y - routes.points[last, 1], z - routes.points[last, 2]
    return dx * dx + dy * dy + dz * dz < DONE_WITHIN_M * DONE_WITHIN_M
