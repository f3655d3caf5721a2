"""A run's environment, its agent, and the eyes with which it looked: as they were in the run."""

from __future__ import annotations

from typing import Any

from agents import AgentSpecError
from agents.base import Agent
from agents.faults import agents_code, describe
from agents.generators import generators
from di_envs.edits.text import EditError
from di_envs.route_env import RouteEnv
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.recorded_edits import seen_edits
from leaderboard.replaying.replay import ReplayError, replay_env, sensor_options
from leaderboard.running.front_camera import with_front_camera
from leaderboard.running.interventions import Interventions, seen_space, sort_interventions
from wrappers.interventions.eyes import Eyes


class RetraceError(Exception):
    """A drive that the agent does not repeat here; the message says where, and why it may be."""


def retrace_env(run: RunRecord, *, front: bool = False, prompt: bool = False) -> RouteEnv:
    """An environment that shows what a run's agent saw.

    Args:
        run: The run.
        front: Whether it has a front camera even if the agent has no cameras.
        prompt: Whether it shows the prompt even if the agent has none.

    Raises:
        ReplayError: If it cannot be made here.
    """
    options = sensor_options(run)
    if front:
        options = with_front_camera(options)
    if prompt and "prompt" not in options["observations"]:
        options["observations"] = (*options["observations"], "prompt")
    return replay_env(run, rules=run.rules, **options)


def run_agent(run: RunRecord, env: RouteEnv) -> Agent[Any]:
    """The agent of a run, edited inside as it was.

    Raises:
        RetraceError: If it cannot be made here.
    """
    try:
        with generators() as drawn, agents_code():
            drawn.begin(0)  # as where it drove
            return run_interventions(run, env).agent(run.agent)
    except KeyboardInterrupt:
        raise
    except EditError as error:
        raise RetraceError(f"the run's interventions cannot be made here: {error}") from error
    except AgentSpecError as error:
        raise RetraceError(f"the run's agent is not to be had here: {error}") from error
    except BaseException as error:
        raise RetraceError(f"agent '{run.agent}' cannot be made: {describe(error)}") from error


def run_interventions(run: RunRecord, env: RouteEnv) -> Interventions:
    """What the run edited of what its agent saw, sorted by who carries it out.

    Args:
        run: The run.
        env: Shows what its agent saw, and may show more.

    Raises:
        EditError: If a text cannot be read.
    """
    space = seen_space(run.requires["observations"], env.config)
    return sort_interventions(seen_edits(run.interventions), space)


def run_eyes(run: RunRecord, record: RouteRecord, env: RouteEnv) -> Eyes:
    """The eyes with which a route's agent looked at first.

    Raises:
        ReplayError: If the record's interventions cannot be made here.
    """
    space = seen_space(run.requires["observations"], env.config)
    try:
        return sort_interventions(seen_edits(record.interventions), space).eyes()
    except EditError as error:
        raise ReplayError(f"the record's interventions cannot be made here: {error}") from error
