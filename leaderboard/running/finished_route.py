"""The record that a route becomes at its end: its log, its score, and the bound beside it."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.config import ROUTE_WEATHER
from di_envs.route_env import RouteEnv
from di_envs.rules import Rules
from di_envs.sensors.route_weather import keyframes_of, keyframes_text
from di_envs.town.plan import RoutePlan
from di_envs.world.state import TICK_S, EventKind
from di_envs.world.world import Event, WorldView
from leaderboard.records.packing import pack
from leaderboard.records.record import (
    CHECK_TYPE,
    CONTROL_TYPE,
    SIMULATION_CRASHED,
    EventRecord,
    RouteRecord,
    undriven_record,
)
from leaderboard.running.bound import light_limited_bound
from leaderboard.running.jobs import Job
from leaderboard.running.log import EpisodeLog, event_record
from leaderboard.scoring.score import Progress, score_route


def route_record(
    view: WorldView,
    job: Job,
    rules: Rules,
    log: EpisodeLog,
    *,
    fault: tuple[str, str] = ("", ""),
    interventions: tuple[str, ...] = (),
    weather: str = "",
    wall_s: float = 0.0,
) -> RouteRecord:
    """The finished route: its score, and everything needed to tell it from another.

    Args:
        view: The world at the end.
        job: What was to be driven.
        rules: What the score goes by.
        log: What was gathered.
        fault: CARLA's status and the reason, where code ended the route.
        interventions: What was done to the world or to what the agent saw, as text.
        weather: What cameras saw, see `shown_weather`.
        wall_s: Wall-clock time that it took.
    """
    state, plan, ego = view.state, view.plans[view.ego], view.ego
    events = (*log.events, *_outside_lanes_so_far(view, log))
    status, reason = fault
    progress = Progress(
        done_m=float(state.route_done_m[ego]),
        length_m=plan.length_m,
        completed=state.finished[ego] == EventKind.COMPLETED and not reason,
        travelled_m=float(state.outside_done_m[ego]),
    )
    observation_hash, reward_hash, event_hash = log.hashes.hex()
    return RouteRecord(
        route_id=job.route_id,
        seed=job.seed,
        index=job.index,
        world_seed=job.world_seed,
        status=status or rules.status(event.kind for event in events),
        reason=reason,
        score=score_route(events, progress, rules),
        length_m=plan.length_m,
        keypoints_m=polyline_m(plan.keypoints),
        done_m=progress.done_m,
        travelled_m=float(state.outside_done_m[ego]),
        game_s=round(int(state.tick) * TICK_S, 6),
        steps=log.steps,
        wall_s=wall_s,
        bound=light_limited_bound(view.town, plan, job.world_seed),
        events=events,
        interventions=interventions,
        weather=weather,
        scenarios=_scenarios(events),
        route_hash=route_hash(plan),
        observation_hash=observation_hash,
        reward_hash=reward_hash,
        event_hash=event_hash,
        state_hash=log.hashes.state_hex(state),
        controls=pack(log.control_array(), CONTROL_TYPE),
        observation_checks=pack(log.hashes.checks(), CHECK_TYPE),
        trace=log.trace(),
    )


def shown_weather(env: RouteEnv) -> str:
    """What cameras see on the route being driven, but for what is edited: as records have it."""
    name = env.config.weather or ""
    return keyframes_text(keyframes_of(env.plan.weathers)) if name == ROUTE_WEATHER else name


def _scenarios(events: Iterable[EventRecord]) -> Mapping[str, int]:
    """How many scenarios began of each type, by the Leaderboard's number."""
    types = sorted(int(event.value) for event in events if event.kind == EventKind.SCENARIO)
    return {str(number): count for number, count in Counter(types).items()}


def lost_record(job: Job, reason: str) -> RouteRecord:
    """A route of which nothing is known: its simulator or its process died."""
    return undriven_record(
        route_id=job.route_id,
        seed=job.seed,
        index=job.index,
        world_seed=job.world_seed,
        status=SIMULATION_CRASHED,
        reason=reason,
    )


def _outside_lanes_so_far(view: WorldView, log: EpisodeLog) -> tuple[EventRecord, ...]:
    """The metres outside lanes where a fault kept the world from saying them at the end."""
    state, ego = view.state, view.ego
    said = any(event.kind == EventKind.OUTSIDE_LANES for event in log.events)
    if said or not state.outside_m[ego] > 0.0:
        return ()
    event = Event(
        kind=EventKind.OUTSIDE_LANES,
        ego=ego,
        tick=int(state.tick),
        x=float(state.x[ego]),
        y=float(state.y[ego]),
        z=float(state.z[ego]),
        value=float(state.outside_m[ego]),
    )
    return (event_record(event, view),)


def route_hash(plan: RoutePlan) -> str:
    """A hash of the route's town, points, options, targets and scenarios."""
    digest = hashlib.blake2b(plan.town.encode(), digest_size=16)
    for array in (plan.points, plan.option, plan.targets):
        digest.update(array.tobytes())
    for trigger in plan.scenarios:
        digest.update(f"{trigger.point} {trigger.type} {trigger.subtype}\0".encode())
    return digest.hexdigest()


def polyline_m(keypoints: NDArray[Any]) -> float:
    """Length [m] of the straight lines through (K, 3) keypoints."""
    return float(np.linalg.norm(np.diff(keypoints, axis=0), axis=1).sum())
