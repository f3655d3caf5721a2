"""A recorded drive once more with its agent: what it saw, remembered and did at every decision.

A record keeps the controls and a hash of each observation, but neither the observations nor the
agent's memory. So the route is replayed with the agent's sensors and the agent decides again; what
it sees and what it does are compared with the record, bit for bit. Whoever wants to look into the
agent at a moment of a drive gets here what it had before it then.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from agents import AgentSpecError
from agents.base import Agent, Control, Observation
from agents.versions import agent_version
from di_envs.edits.text import EditError
from di_envs.observation import observation_space
from di_envs.route_env import RouteEnv
from di_envs.sensors.camera.config import Rig, rig_of
from leaderboard.records.episode_hash import observation_check
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.replay import ReplayError, ReplayStep, replay, replay_env, sensor_options
from leaderboard.running.episode import close_agent, describe, extra_keys, plan_shown
from leaderboard.running.interventions import (
    Interventions,
    observation_interventions,
    sort_interventions,
)
from wrappers.interventions.context import EditContext, context_of
from wrappers.interventions.editing import Memory, ObservationEditing

FRONT = "camera_front"


class RetraceError(Exception):
    """A drive that the agent does not repeat here; the message says where, and why it may be."""


@dataclass(frozen=True, kw_only=True)
class Eyes:
    """What an agent sees of an observation: its own part of it, edited. A value, like a memory.

    Attributes:
        keys: Entries that it sees at all.
        edits: One after the other.
        memory: What each of them remembers of the moments before.
    """

    keys: frozenset[str]
    edits: tuple[ObservationEditing, ...] = ()
    memory: tuple[Memory, ...] = ()

    def behind(self, edit: ObservationEditing) -> Eyes:
        """These eyes, and one more edit after those that there are, which has seen nothing yet."""
        return replace(self, edits=(*self.edits, edit), memory=(*self.memory, edit.start()))

    def look(
        self, observation: Mapping[str, Any], context: EditContext
    ) -> tuple[Mapping[str, Any], Eyes]:
        """What is seen of an observation, and the eyes for the next moment."""
        shown: Mapping[str, Any] = {
            key: value for key, value in observation.items() if key in self.keys
        }
        kept = []
        for edit, memory in zip(self.edits, self.memory, strict=True):
            shown, after = edit.apply(shown, context, memory)
            kept.append(after)
        return shown, replace(self, memory=tuple(kept))


@dataclass(frozen=True, kw_only=True)
class Decision:
    """A moment of a recorded drive, and what its agent made of it.

    Attributes:
        number: How many decisions came before.
        step: The moment. Its world shows the next one once the next decision is asked for.
        seen: What the agent was handed: edited as in the run, without what it does not see.
        eyes: With which it looked, as they were before it did.
        memory: What it remembered, before it decided.
        control: What it did, as recorded; None at the end of the route, where it did nothing.
        context: The moment, for edits.
    """

    number: int
    step: ReplayStep
    seen: Observation
    eyes: Eyes
    memory: Any
    control: Control | None
    context: EditContext

    @property
    def time_s(self) -> float:
        """Game time."""
        return self.step.time_s


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
    if front and "camera" not in options["observations"]:
        cameras = tuple(c for c in rig_of("small").cameras if c.name == FRONT)
        options["observations"] = (*options["observations"], "camera")
        options["cameras"] = Rig(cameras=cameras)
    if prompt and "prompt" not in options["observations"]:
        options["observations"] = (*options["observations"], "prompt")
    return replay_env(run, rules=run.rules, **options)


def run_agent(run: RunRecord, env: RouteEnv) -> Agent[Any]:
    """The agent of a run, edited inside as it was.

    Raises:
        RetraceError: If it cannot be made here.
    """
    try:
        return run_interventions(run, env).agent(run.agent)
    except EditError as error:
        raise RetraceError(f"the run's interventions cannot be made here: {error}") from error
    except AgentSpecError as error:
        raise RetraceError(f"the run's agent is not to be had here: {error}") from error
    except (Exception, SystemExit) as error:
        raise RetraceError(f"agent '{run.agent}' cannot be made: {describe(error)}") from error


def run_interventions(run: RunRecord, env: RouteEnv) -> Interventions:
    """What the run edited of what its agent saw, sorted by who carries it out.

    Raises:
        EditError: If a text cannot be read.
    """
    return sort_interventions(observation_interventions(run.interventions), own_space(run, env))


def own_space(run: RunRecord, env: RouteEnv) -> spaces.Dict:
    """The space of what the agent itself sees, whatever else `env` shows."""
    groups = tuple(run.requires["observations"])
    config = env.config
    half = config.half_sweeps
    return observation_space(groups, config.cameras, config.lidar, half_sweeps=half)


def retrace(
    run: RunRecord,
    record: RouteRecord,
    *,
    agent: Agent[Any] | None = None,
    env: RouteEnv | None = None,
) -> Iterator[Decision]:
    """Drives a recorded route again with its agent, decision by decision.

    At each yield the agent has not decided yet. Before it asks for more the caller may step the
    environment, if it puts it back where it was.

    Args:
        run: The run that the record is of.
        record: The route.
        agent: From `run_agent`; None makes one, and closes it at the end.
        env: From `retrace_env(run)`, so that several routes may share it; None makes one.

    Yields:
        Every decision, and the moment after the last one.

    Raises:
        RetraceError: If the agent cannot be made, or sees or does what it did not do in the run.
        ReplayError: If the route cannot be replayed here.
    """
    if record.lost:
        raise RetraceError(
            f"route {record.route_id}, seed {record.seed} was lost to the machinery: "
            f"{record.reason}"
        )
    env = env or retrace_env(run)
    eyes, checks = run_eyes(run, record, env), _checks(record)
    driver = agent or run_agent(run, env)
    try:
        yield from _decisions(run, record, driver, env, eyes, checks)
    finally:
        if agent is None:
            close_agent(driver)


def run_eyes(run: RunRecord, record: RouteRecord, env: RouteEnv) -> Eyes:
    """The eyes with which a route's agent looked at first.

    Raises:
        ReplayError: If the record's interventions cannot be made here.
    """
    space = own_space(run, env)
    eyes = Eyes(keys=frozenset(space))
    try:
        texts = observation_interventions(record.interventions)
        return eyes.behind(sort_interventions(texts, space).editing(space))
    except EditError as error:
        raise ReplayError(f"the record's interventions cannot be made here: {error}") from error


def _decisions(
    run: RunRecord,
    record: RouteRecord,
    agent: Agent[Any],
    env: RouteEnv,
    eyes: Eyes,
    checks: NDArray[np.uint32],
) -> Iterator[Decision]:
    controls, memory = record.control_array(), None
    dt_s = env.config.control_dt_s
    for step in replay(run, record, env=env):
        if step.decision == 0:
            memory = agent.start(plan_shown(agent.requires, env.plan), record.world_seed)
        before, context = eyes, context_of(step.info, dt_s)
        shown, eyes = eyes.look(step.observation, context)
        _check_seen(shown, int(checks[step.decision]), step)
        seen = {**shown, **extra_keys(agent.requires, step.view)}
        control = controls[step.decision] if step.decision < len(controls) else None
        yield Decision(
            number=step.decision,
            step=step,
            seen=seen,
            eyes=before,
            memory=memory,
            control=control,
            context=context,
        )
        if control is not None:
            memory = _decided(run, agent, seen, memory, control, step)


def _checks(record: RouteRecord) -> NDArray[np.uint32]:
    try:
        checks = record.check_array()
    except ValueError as error:
        raise ReplayError(f"the observations' hashes cannot be read: {error}") from error
    if len(checks) != record.steps + 1:
        raise ReplayError(
            f"there are {len(checks)} hashes of observations for {record.steps} decisions"
        )
    return checks


def _check_seen(shown: Mapping[str, Any], recorded: int, step: ReplayStep) -> None:
    if observation_check(shown) != recorded:
        raise RetraceError(
            f"at {step.time_s:g} s the agent would see what it did not see in the run: the "
            "package versions or the CPU are not those of the run; `driveinsight verify "
            "--observations` says what differs"
        )


def _decided(
    run: RunRecord,
    agent: Agent[Any],
    seen: Observation,
    memory: Any,
    recorded: Control,
    step: ReplayStep,
) -> Any:
    """The memory after a decision that must be the recorded one."""
    try:
        control, after = agent.act(seen, memory)
    except (Exception, SystemExit) as error:
        raise RetraceError(f"the agent fails at {step.time_s:g} s: {describe(error)}") from error
    if not np.array_equal(np.asarray(control, np.float32), recorded):
        raise RetraceError(
            f"at {step.time_s:g} s the agent acts otherwise than recorded: {_why(run)}"
        )
    return after


def _why(run: RunRecord) -> str:
    """What may be the reason, as far as it can be told."""
    if agent_version(run.agent) != run.agent_version:
        return (
            f"the code or the weights that '{run.agent}' leads to are not those of the run; put "
            "them back, or evaluate again"
        )
    return "the package versions or the CPU are not those of the run; evaluate again here"
