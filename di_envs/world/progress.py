# mypy: disallow_untyped_defs=False
"""How far along its route an ego has come, by Leaderboard 1.0's route completion test."""

from __future__ import annotations

import math

from di_envs.kernels import kernel

WINDOW = 2  # route points looked at beyond the present one
DONE_SHARE = 0.99  # of the route's length, more than which must lie behind
DONE_WITHIN_M = 10.0  # of its last point


@kernel
def is_past(routes, point, x, y):
    """Whether a position lies ahead of a route point, seen along the lane there.

    There is no limit to the side, so a route's lateral jumps (lane changes) and backward steps
    (where keypoints join) do no harm.
    """
    yaw = routes.points[point, 3]
    dx, dy = x - routes.points[point, 0], y - routes.points[point, 1]
    return dx * math.cos(yaw) + dy * math.sin(yaw) > 0.0


@kernel
def advance_progress(state, routes, ego):
    """Moves an ego's route index, metres done and next target on; they never go back."""
    if state.finished[ego] != 0:
        return
    first, end = routes.start[ego], routes.start[ego + 1]
    now = first + state.route_index[ego]
    for point in range(now, min(now + WINDOW + 1, end)):
        if is_past(routes, point, state.x[ego], state.y[ego]):
            state.route_index[ego] = point - first
            state.route_done_m[ego] = routes.route_m[point]

    targets = routes.target_start[ego + 1] - routes.target_start[ego]
    while (
        state.target_index[ego] + 1 < targets
        and routes.target[routes.target_start[ego] + state.target_index[ego]]
        <= state.route_index[ego]
    ):
        state.target_index[ego] += 1


@kernel
def route_completed(state, routes, ego):
    """Whether more than 99 % are done and the last point is less than 10 m away."""
    last = routes.start[ego + 1] - 1
    if not state.route_done_m[ego] > DONE_SHARE * routes.route_m[last]:
        return False
    dx = state.x[ego] - routes.points[last, 0]
    dy = state.y[ego] - routes.points[last, 1]
    dz = state.z[ego] - routes.points[last, 2]
    return dx * dx + dy * dy + dz * dz < DONE_WITHIN_M * DONE_WITHIN_M
