"""Driving slower than the traffic around, by Leaderboard 2.x: an event at a failed checkpoint.

A route has four checkpoints, a quarter of its length apart. Since the last one, the ego's mean
speed is compared with that of the traffic near it, over the ticks that there was any.

Source: CARLA scenario_runner 2.x, `MinimumSpeedRouteTest`. There all background traffic is kept
within some fifty metres of the ego, so its mean is that of all; ours is spread over the town, so
the mean is over those as near as that, on the ego's level.
"""

from __future__ import annotations

from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel
from di_envs.world.bodies import EgoNow
from di_envs.world.events.rows import record
from di_envs.world.state import CHECKPOINTS, ActorKind, EventKind, Routes, State

NEAR_M = 50.0  # of the ego, within which traffic sets the pace
SAME_LEVEL_M = 3.0
LAST_SHARE = 0.95  # of the route, beyond which its end is a checkpoint too

ABSENT, MIN_SPEED = int(ActorKind.ABSENT), int(EventKind.MIN_SPEED)


@kernel
def begin_pace(state: State, ego: int) -> None:
    """Clears what is remembered of an ego's pace, at the start of its route."""
    state.checkpoint[ego] = 0
    state.pace_share[ego, :] = 1.0
    _begin_stretch(state, ego, 0.0)


@kernel
def _begin_stretch(state: State, ego: int, from_m: float) -> None:
    """Forgets the speeds so far; the stretch begins at this route metre."""
    state.pace_from_m[ego] = from_m
    state.pace_ego[ego] = 0.0
    state.pace_traffic[ego] = 0.0


@kernel
def watch_pace(
    state: State, routes: Routes, now: EgoNow, vehicle_end: int, out: Float64, n: int
) -> int:
    """Judges the pace at a checkpoint, then adds this tick's speeds to the next stretch.

    Args:
        state: The world; what it remembers of the ego's pace changes.
        routes: The egos' routes.
        now: The ego now (`EgoNow`).
        vehicle_end: First actor id behind the vehicles.
        out: Event rows.
        n: Rows in use.

    Returns:
        The number of rows in use.
    """
    e = now.ego
    done_m = state.route_done_m[e]
    stretch_m = routes.route_m[routes.start[e + 1] - 1] / CHECKPOINTS
    if done_m - state.pace_from_m[e] > stretch_m:
        n = _judge(state, now, out, n)
        _begin_stretch(state, e, done_m)
    total, count = 0.0, 0
    for actor in range(state.throttle.size, vehicle_end):
        if state.kind[actor] == ABSENT or abs(state.z[actor] - now.z) > SAME_LEVEL_M:
            continue
        dx, dy = state.x[actor] - now.x, state.y[actor] - now.y
        if dx * dx + dy * dy <= NEAR_M * NEAR_M:
            total += state.speed[actor]
            count += 1
    if count > 0:
        state.pace_ego[e] += now.speed
        state.pace_traffic[e] += total / count
    return n


@kernel
def close_pace(state: State, routes: Routes, now: EgoNow, out: Float64, n: int) -> int:
    """Judges the last stretch as the route ends: only if nearly all of it is done, as in CARLA."""
    length_m = routes.route_m[routes.start[now.ego + 1] - 1]
    if state.route_done_m[now.ego] > LAST_SHARE * length_m:
        n = _judge(state, now, out, n)
    return n


@kernel
def _judge(state: State, now: EgoNow, out: Float64, n: int) -> int:
    """Keeps the ego's share of the traffic's pace; an event if it was the slower one."""
    e = now.ego
    at = state.checkpoint[e]
    if at >= CHECKPOINTS:
        return n
    share = 1.0
    if state.pace_traffic[e] > 0.0:
        share = min(state.pace_ego[e] / state.pace_traffic[e], 1.0)
    state.pace_share[e, at] = share
    state.checkpoint[e] = at + 1
    if share < 1.0:
        n = record(out, n, MIN_SPEED, e, now.tick, now.x, now.y, now.z, -1, 100.0 * share)
    return n
