"""Drives one route with one agent and writes down what happened, whatever the agent does.

An agent that raises, returns NaN or leaves the action space fails on this route, with the reason;
what it had driven by then still counts, as in CARLA.
"""

from __future__ import annotations

import dataclasses
import math
import time
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from agents.base import Agent, Requirements
from di_envs.rules import Rules
from di_envs.sensors.carla_suite import SensorSuiteError
from di_envs.town.plan import RoutePlan
from di_envs.world.world import WorldView
from leaderboard.records.record import (
    AGENT_CRASHED,
    NOT_SET_UP,
    SENSORS_INVALID,
    SIMULATION_CRASHED,
    RouteRecord,
)
from leaderboard.running.finished_route import lost_record, route_record, shown_weather
from leaderboard.running.jobs import Job
from leaderboard.running.log import EpisodeLog

_LOW, _HIGH = (0.0, -1.0, 0.0), (1.0, 1.0, 1.0)
_CONTROL_NAMES = ("throttle", "steer", "brake")


class FaultError(Exception):
    """The agent's or the simulator's code failed: a status of CARLA's and the reason."""

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(reason)
        self.status, self.reason = status, reason


def drive_route(
    env: Any,
    new_agent: Callable[[], Agent[Any]],
    job: Job,
    rules: Rules,
    *,
    requires: Requirements | None = None,
    interventions: tuple[str, ...] = (),
) -> RouteRecord:
    """Drives `job` in `env` (a RouteEnv) with a fresh agent, to the end of the route or a fault.

    Args:
        env: A `RouteEnv`, wrapped or not.
        new_agent: Makes the agent.
        job: The route and the seed.
        rules: What the score goes by.
        requires: What the agent requires, where that is known: some must be set up to find out.
        interventions: What the environment's wrappers do to what the agent sees, for the record.
    """
    started_s = time.perf_counter()
    try:
        observation = _reset(env, job)
    except FaultError as fault:
        return lost_record(job, fault.reason)
    log = EpisodeLog(env.unwrapped.view)
    status = reason = ""
    try:
        _drive(env, new_agent, requires, observation, job, log)
    except FaultError as fault:
        status, reason = fault.status, fault.reason
        if log.steps == 0 and status == SIMULATION_CRASHED:
            return lost_record(job, reason)
    return route_record(
        env.unwrapped.view,
        job,
        rules,
        log,
        fault=(status, reason),
        weather=shown_weather(env.unwrapped),
        interventions=interventions,
        wall_s=time.perf_counter() - started_s,
    )


def _reset(env: Any, job: Job) -> Mapping[str, Any]:
    try:
        observation, _ = env.reset(seed=job.world_seed, options={"route": job.route_id})
    except Exception as error:
        raise FaultError(SIMULATION_CRASHED, describe(error)) from error
    return observation


def _drive(
    env: Any,
    new_agent: Callable[[], Agent[Any]],
    requires: Requirements | None,
    observation: Mapping[str, Any],
    job: Job,
    log: EpisodeLog,
) -> None:
    """Lets the agent drive until the environment says that the route is over."""
    view: WorldView = env.unwrapped.view
    log.hashes.add_observation(observation)
    agent, memory = _start(new_agent, requires, view.plans[view.ego], job)
    try:
        extras = extra_keys(agent.requires, view)
        over = False
        while not over:
            seen = {**observation, **extras} if extras else observation
            control, memory = decide(agent, seen, memory)
            observation, reward, over, info = step(env, control)
            log.add_step(control, reward, info["events"])
            log.hashes.add_observation(observation)
    finally:
        close_agent(agent)


def extra_keys(requires: Requirements, view: WorldView) -> dict[str, Any]:
    """What an agent is handed beside its environment's observation."""
    extras: dict[str, Any] = {"world": view} if requires.privileged else {}
    if requires.hd_map:
        extras["town"] = view.town
    return extras


def plan_shown(requires: Requirements, plan: RoutePlan) -> RoutePlan:
    """The plan as an agent gets it: only privileged ones learn where scenarios begin."""
    return plan if requires.privileged else dataclasses.replace(plan, scenarios=())


def _start(
    new_agent: Callable[[], Agent[Any]],
    requires: Requirements | None,
    plan: RoutePlan,
    job: Job,
) -> tuple[Agent[Any], Any]:
    try:
        agent = new_agent()
        return agent, agent.start(plan_shown(requires or agent.requires, plan), job.world_seed)
    except SensorSuiteError as error:
        raise FaultError(SENSORS_INVALID, str(error)) from error
    except (Exception, SystemExit) as error:
        raise FaultError(NOT_SET_UP, describe(error)) from error


def decide(agent: Agent[Any], observation: Mapping[str, Any], memory: Any) -> tuple[Any, Any]:
    """One decision of the agent, checked: its control, and its memory for the next.

    Raises:
        FaultError: If its code fails, or its control is none.
    """
    try:
        control, memory = agent.act(observation, memory)
        control = np.asarray(control, dtype=np.float32)
    except SensorSuiteError as error:
        raise FaultError(SENSORS_INVALID, str(error)) from error
    except (Exception, SystemExit) as error:
        raise FaultError(AGENT_CRASHED, describe(error)) from error
    wrong = _control_error(control)
    if wrong:
        raise FaultError(AGENT_CRASHED, wrong)
    return control, memory


def _control_error(control: np.ndarray[Any, Any]) -> str:
    """What is wrong with a control [throttle, steer, brake]; empty when nothing is."""
    if control.shape != (3,):
        return f"act returned a control of shape {control.shape}, expected (3,)"
    for name, value, low, high in zip(_CONTROL_NAMES, control.tolist(), _LOW, _HIGH, strict=True):
        if not low <= value <= high:
            kind = "NaN" if math.isnan(value) else f"{value:g}, outside [{low:g}, {high:g}]"
            return f"act returned {name} {kind}"
    return ""


def step(env: Any, control: Any) -> tuple[Mapping[str, Any], float, bool, Mapping[str, Any]]:
    """What a decision leads to: observation, reward, whether the route is over, and `info`.

    Raises:
        FaultError: If the simulator's code fails.
    """
    try:
        observation, reward, terminated, truncated, info = env.step(control)
    except Exception as error:
        raise FaultError(SIMULATION_CRASHED, describe(error)) from error
    return observation, float(reward), terminated or truncated, info


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
