"""All events of CARLA Leaderboard 1.0 for one ego and tick, each by the rule of its own module.

Source: CARLA leaderboard and scenario_runner, branches `leaderboard-1.0`, of which the geometry,
thresholds and de-duplication are kept, traps included; the minimum speed is 2.x's. What `di-1.0`
sees besides is recorded beside it, under kinds of its own. Collisions are recorded where they
happen, in `contact.resolve_contacts`.
"""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Float64
from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, Signals
from di_envs.town.queries import pose_at
from di_envs.world.bodies import EgoNow
from di_envs.world.events.lane_keeping import watch_lanes
from di_envs.world.events.min_speed import begin_pace, close_pace, watch_pace
from di_envs.world.events.red_light import detect_red_light
from di_envs.world.events.route_end import find_route_end
from di_envs.world.events.rows import count_rows, record
from di_envs.world.events.stop_sign import detect_stop_sign
from di_envs.world.state import EventKind, Routes, State

OUTSIDE_LANES = int(EventKind.OUTSIDE_LANES)


@kernel
def begin_events(state: State, ego: int) -> None:
    """Clears what the events remember of an ego, at the start of its route."""
    state.last_collision_actor[ego] = -1
    state.last_collision_tick[ego] = 0
    state.collision_places[ego, :, :] = math.nan
    state.contact_tick[ego, :] = 0
    state.hit[ego, :] = 0
    state.last_red_signal[ego] = -1
    state.last_wide_signal[ego] = -1
    state.stop_target[ego] = -1
    state.stop_done[ego] = 0
    state.stop_affected[ego] = 0
    state.outside_lane[ego] = 0
    state.wrong_lane[ego] = 0
    state.lane_before[ego] = -1
    state.lane_before_yaw[ego] = 0.0
    state.outside_m[ego] = 0.0
    state.outside_done_m[ego] = 0.0
    state.outside_index[ego] = 0
    state.deviation_index[ego] = 0
    state.deviation_m[ego] = 0.0
    state.blocked_ticks[ego] = 0
    state.finished[ego] = 0
    state.counts[ego, :] = 0
    begin_pace(state, ego)


@kernel
def detect_events(
    state: State,
    lanes: Lanes,
    signals: Signals,
    routes: Routes,
    ego: int,
    vehicle_end: int,
    out: Float64,
    n: int,
) -> int:
    """Looks for every event but collisions, after `locate_ego` and `advance_progress`.

    Args:
        state: The world; the ego's event memory, `counts` and `finished` change.
        lanes: The town's lanes.
        signals: The town's signals.
        routes: The egos' routes.
        ego: The ego's actor index.
        vehicle_end: First actor id behind the vehicles.
        out: (N, 8) event rows: kind, ego, tick, x, y, z, other, value.
        n: Rows in use.

    Returns:
        The number of rows in use. Nothing is detected once the route has ended.
    """
    if state.finished[ego] != 0:
        return n
    # integers of one width, so that what reads them is compiled once
    now = EgoNow(
        as_int64(ego),
        int(state.tick[()]),
        state.x[ego],
        state.y[ego],
        state.z[ego],
        state.yaw[ego],
        state.speed[ego],
        state.half_length[ego],
        as_int64(state.lane[ego]),
        state.lane_m[ego],
    )
    before = n
    lane_yaw = pose_at(lanes, now.lane, now.lane_m)[3] if now.lane >= 0 else 0.0
    watch_lanes(state, lanes, routes, now, lane_yaw)
    n = detect_red_light(state, lanes, signals, now, out, n)
    n = detect_stop_sign(state, lanes, signals, now, lane_yaw, out, n)
    n = watch_pace(state, routes, now, vehicle_end, out, n)
    reason = find_route_end(state, routes, now)
    if reason != 0:
        n = close_pace(state, routes, now, out, n)
        n = _end_route(now, reason, state.outside_m[ego], out, n)
        state.finished[ego] = reason
    count_rows(state.counts, out, before, n)
    return n


@kernel
def _end_route(now: EgoNow, reason: int, outside_m: float, out: Float64, n: int) -> int:
    """Records the metres outside lanes, if there are any, and why the route ended."""
    if outside_m > 0.0:
        n = record(out, n, OUTSIDE_LANES, now.ego, now.tick, now.x, now.y, now.z, -1, outside_m)
    return record(out, n, reason, now.ego, now.tick, now.x, now.y, now.z, -1, 0.0)
