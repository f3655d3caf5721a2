"""Drives one route with one agent and writes down what happened, whatever the agent does.

An agent that raises, returns NaN or leaves the action space fails on this route, with the reason;
what it had driven by then still counts, as in CARLA.
"""

from __future__ import annotations

import hashlib
import math
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from agents.base import Agent
from di_envs.town.plan import RoutePlan
from di_envs.world.state import TICK_S, ActorKind, EventKind
from di_envs.world.world import Event, WorldView
from leaderboard.bound import light_limited_bound
from leaderboard.episode_hash import EpisodeHash
from leaderboard.jobs import Job
from leaderboard.record import (
    AGENT_CRASHED,
    NOT_SET_UP,
    SIMULATION_CRASHED,
    EventRecord,
    RouteRecord,
)
from leaderboard.rules import Rules
from leaderboard.score import Progress, Score, score_route

_LOW, _HIGH = (0.0, -1.0, 0.0), (1.0, 1.0, 1.0)
_CONTROL_NAMES = ("throttle", "steer", "brake")
_ACTOR_TYPES: Mapping[int, str] = {
    ActorKind.WALKER: "walker.pedestrian",
    ActorKind.PROP: "static.prop",
}


class FaultError(Exception):
    """The agent's or the simulator's code failed: a status of CARLA's and the reason."""

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(reason)
        self.status, self.reason = status, reason


@dataclass(kw_only=True)
class _Log:
    """What gathers while a route is driven."""

    hashes: EpisodeHash = field(default_factory=EpisodeHash)
    events: list[EventRecord] = field(default_factory=list)
    steps: int = 0


def drive_route(
    env: Any, new_agent: Callable[[], Agent[Any]], job: Job, rules: Rules
) -> RouteRecord:
    """Drives `job` in `env` (a RouteEnv) with a fresh agent, to the end of the route or a fault."""
    started_s = time.perf_counter()
    log = _Log()
    status = reason = ""
    try:
        observation = _reset(env, job)
        _drive(env, new_agent, observation, job, log)
    except FaultError as fault:
        status, reason = fault.status, fault.reason
        if log.steps == 0 and status == SIMULATION_CRASHED:
            return lost_record(job, reason)
    return _record(env.unwrapped.view, job, rules, log, (status, reason), started_s)


def _reset(env: Any, job: Job) -> Mapping[str, Any]:
    try:
        observation, _ = env.reset(seed=job.world_seed, options={"route": job.route_id})
    except Exception as error:
        raise FaultError(SIMULATION_CRASHED, describe(error)) from error
    return observation


def _drive(
    env: Any,
    new_agent: Callable[[], Agent[Any]],
    observation: Mapping[str, Any],
    job: Job,
    log: _Log,
) -> None:
    """Lets the agent drive until the environment says that the route is over."""
    view: WorldView = env.unwrapped.view
    agent, memory = _start(new_agent, view.plans[view.ego], job)
    try:
        privileged = agent.requires.privileged
        log.hashes.add_observation(observation)
        over = False
        while not over:
            seen = {**observation, "world": view} if privileged else observation
            control, memory = _act(agent, seen, memory)
            observation, reward, over, events = _step(env, control)
            log.steps += 1
            log.hashes.add_observation(observation)
            log.hashes.add_reward(reward)
            log.hashes.add_events(events)
            log.events += [_event_record(event, view) for event in events]
    finally:
        close_agent(agent)


def _start(
    new_agent: Callable[[], Agent[Any]], plan: RoutePlan, job: Job
) -> tuple[Agent[Any], Any]:
    try:
        agent = new_agent()
        return agent, agent.start(plan, job.world_seed)
    except (Exception, SystemExit) as error:
        raise FaultError(NOT_SET_UP, describe(error)) from error


def _act(agent: Agent[Any], observation: Mapping[str, Any], memory: Any) -> tuple[Any, Any]:
    """One decision of the agent, checked."""
    try:
        control, memory = agent.act(observation, memory)
        control = np.asarray(control, dtype=np.float32)
    except (Exception, SystemExit) as error:
        raise FaultError(AGENT_CRASHED, describe(error)) from error
    wrong = control_error(control)
    if wrong:
        raise FaultError(AGENT_CRASHED, wrong)
    return control, memory


def control_error(control: np.ndarray[Any, Any]) -> str:
    """What is wrong with a control [throttle, steer, brake]; empty when nothing is."""
    if control.shape != (3,):
        return f"act returned a control of shape {control.shape}, expected (3,)"
    for name, value, low, high in zip(_CONTROL_NAMES, control.tolist(), _LOW, _HIGH, strict=True):
        if not low <= value <= high:
            kind = "NaN" if math.isnan(value) else f"{value:g}, outside [{low:g}, {high:g}]"
            return f"act returned {name} {kind}"
    return ""


def _step(env: Any, control: Any) -> tuple[Mapping[str, Any], float, bool, list[Event]]:
    try:
        observation, reward, terminated, truncated, info = env.step(control)
    except Exception as error:
        raise FaultError(SIMULATION_CRASHED, describe(error)) from error
    return observation, float(reward), terminated or truncated, info["events"]


def close_agent(agent: Agent[Any]) -> None:
    """Closes the agent; one that cannot even close has driven all the same."""
    try:
        agent.close()
    except (Exception, SystemExit) as error:
        warnings.warn(f"the agent's close() failed: {describe(error)}", stacklevel=2)


def describe(error: BaseException) -> str:
    """An exception and the line that raised it, in one line."""
    text = " ".join(str(error).split())
    where, trace = "", error.__traceback__
    while trace is not None:
        where = f" at {trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}"
        trace = trace.tb_next
    return f"{type(error).__name__}: {text}{where}" if text else f"{type(error).__name__}{where}"


def _event_record(event: Event, view: WorldView) -> EventRecord:
    collision = EventKind.COLLISION_WALKER <= event.kind <= EventKind.COLLISION_STATIC
    other = int(view.state.kind[event.other]) if collision and event.other >= 0 else 0
    default = f"vehicle.{ActorKind(other).name.lower()}" if other else ""
    return EventRecord(
        kind=EventKind(event.kind),
        tick=int(event.tick),
        time_s=round(event.tick * TICK_S, 6),
        x=float(event.x),
        y=float(event.y),
        z=float(event.z),
        other=int(event.other),
        other_type=_ACTOR_TYPES.get(other, default),
        value=float(event.value),
    )


def _record(
    view: WorldView,
    job: Job,
    rules: Rules,
    log: _Log,
    fault: tuple[str, str],
    started_s: float,
) -> RouteRecord:
    """The finished route: its score, and everything needed to tell it from another."""
    state, plan, ego = view.state, view.plans[view.ego], view.ego
    _add_outside_lanes(view, log)
    finished = int(state.finished[ego])
    status, reason = fault
    progress = Progress(
        done_m=float(state.route_done_m[ego]),
        length_m=plan.length_m,
        completed=finished == EventKind.COMPLETED and not reason,
        travelled_m=float(state.outside_done_m[ego]),
    )
    observation_hash, reward_hash, event_hash = log.hashes.hex()
    return RouteRecord(
        route_id=job.route_id,
        seed=job.seed,
        index=job.index,
        world_seed=job.world_seed,
        status=status or _ending(finished, rules),
        reason=reason,
        score=score_route(log.events, progress, rules),
        length_m=plan.length_m,
        keypoints_m=polyline_m(plan.keypoints),
        done_m=progress.done_m,
        travelled_m=float(state.outside_done_m[ego]),
        game_s=round(int(state.tick) * TICK_S, 6),
        steps=log.steps,
        wall_s=time.perf_counter() - started_s,
        bound=light_limited_bound(view.town, plan, job.world_seed),
        events=tuple(log.events),
        route_hash=route_hash(plan),
        observation_hash=observation_hash,
        reward_hash=reward_hash,
        event_hash=event_hash,
    )


def _ending(finished: int, rules: Rules) -> str:
    """CARLA's status; plain Failed when `terminate_on` ended the route by an infraction."""
    return rules.endings.get(EventKind(finished), "Failed") if finished else "Failed"


def _add_outside_lanes(view: WorldView, log: _Log) -> None:
    """Adds the metres outside lanes where a fault kept the world from saying them at the end."""
    if any(event.kind == EventKind.OUTSIDE_LANES for event in log.events):
        return
    state, ego = view.state, view.ego
    if state.outside_m[ego] > 0.0:
        event = Event(
            kind=EventKind.OUTSIDE_LANES,
            ego=ego,
            tick=int(state.tick),
            x=float(state.x[ego]),
            y=float(state.y[ego]),
            z=float(state.z[ego]),
            value=float(state.outside_m[ego]),
        )
        log.events.append(_event_record(event, view))


def lost_record(job: Job, reason: str) -> RouteRecord:
    """A route of which nothing is known: its simulator or its process died."""
    return RouteRecord(
        route_id=job.route_id,
        seed=job.seed,
        index=job.index,
        world_seed=job.world_seed,
        status=SIMULATION_CRASHED,
        reason=reason,
        score=Score(route_completion=0.0, infraction_score=1.0),
        length_m=0.0,
        keypoints_m=0.0,
        done_m=0.0,
        travelled_m=0.0,
        game_s=0.0,
        steps=0,
        wall_s=0.0,
        bound=None,
        route_hash="",
        observation_hash="",
        reward_hash="",
        event_hash="",
    )


def route_hash(plan: RoutePlan) -> str:
    """A hash of the route's town, points, options and targets."""
    digest = hashlib.blake2b(plan.town.encode(), digest_size=16)
    for array in (plan.points, plan.option, plan.targets):
        digest.update(array.tobytes())
    return digest.hexdigest()


def polyline_m(keypoints: np.ndarray[Any, Any]) -> float:
    """Length [m] of the straight lines through (K, 3) keypoints."""
    return float(np.linalg.norm(np.diff(keypoints, axis=0), axis=1).sum())
