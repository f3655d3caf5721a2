"""Drives one route with one agent and writes down what happened, whatever the agent does.

An agent that raises whatever it likes, returns NaN or leaves the action space fails on this route,
with the reason; what it had driven by then still counts, as in CARLA. Every route begins in the
same folder and with random numbers of its own, whatever an agent did in the one before.
"""

from __future__ import annotations

import dataclasses
import os
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from agents.base import Agent, Requirements
from agents.faults import AgentDiedError, agents_code, as_control, describe
from agents.generators import Generators, generators
from di_envs.rules import Rules
from di_envs.sensors.carla_sensor import SensorSuiteError
from di_envs.town.plan import RoutePlan
from di_envs.world.world import WorldView
from leaderboard.records.record import (
    AGENT_CRASHED,
    LOST,
    NOT_SET_UP,
    SENSORS_INVALID,
    SIMULATION_CRASHED,
    WORKER_DIED,
    RouteRecord,
)
from leaderboard.running.finished_route import lost_record, route_record, shown_weather
from leaderboard.running.jobs import Job
from leaderboard.running.log import EpisodeLog


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
        requires: What the agent may have, as the run says; None takes the agent's word.
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
        with _same_beginning() as drawn:
            _drive(env, new_agent, requires, observation, job, log, drawn)
    except FaultError as fault:
        status, reason = fault.status, fault.reason
        if status == WORKER_DIED or (log.steps == 0 and status in LOST):
            return dataclasses.replace(lost_record(job, reason), status=status)
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


@contextmanager
def _same_beginning() -> Iterator[Generators]:
    """Random numbers and the folder are an agent's within, and as they were afterwards."""
    folder = os.getcwd()
    try:
        with generators() as drawn:
            yield drawn
    finally:
        os.chdir(folder)


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
    drawn: Generators,
) -> None:
    """Lets the agent drive until the environment says that the route is over."""
    view: WorldView = env.unwrapped.view
    log.hashes.add_observation(observation)
    agent, memory = _start(new_agent, requires, view.plans[view.ego], job, drawn)
    try:
        extras = extra_keys(requires or agent.requires, view)
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
    drawn: Generators,
) -> tuple[Agent[Any], Any]:
    try:
        with agents_code():
            drawn.begin(0)
            agent = new_agent()
            shown = plan_shown(requires or agent.requires, plan)
            drawn.begin(job.world_seed)
            return agent, agent.start(shown, job.world_seed)
    except BaseException as error:
        raise _fault(error, NOT_SET_UP) from error


def _fault(error: BaseException, status: str) -> BaseException:
    """What the agent's code raised, as a fault with that status; Ctrl-C stays what it is."""
    if isinstance(error, KeyboardInterrupt):
        return error
    if isinstance(error, SensorSuiteError):
        return FaultError(SENSORS_INVALID, str(error))
    return FaultError(WORKER_DIED if isinstance(error, AgentDiedError) else status, describe(error))


def decide(agent: Agent[Any], observation: Mapping[str, Any], memory: Any) -> tuple[Any, Any]:
    """One decision of the agent, checked: its control, and its memory for the next.

    Raises:
        FaultError: If its code fails, or its control is none.
    """
    try:
        with agents_code():
            given, memory = agent.act(observation, memory)
            control, wrong = as_control(given)
    except BaseException as error:
        raise _fault(error, AGENT_CRASHED) from error
    if wrong:
        raise FaultError(AGENT_CRASHED, wrong)
    return control, memory


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
        with agents_code():
            agent.close()
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        warnings.warn(f"the agent's close() failed: {describe(error)}", stacklevel=2)
