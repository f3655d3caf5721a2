"""A recorded drive once more with its agent: what it saw, remembered and did at every decision.

A record keeps the controls and a hash of each observation, but neither the observations nor the
agent's memory. So the route is replayed with the agent's sensors and the agent decides again; what
it sees and what it does are compared with the record, bit for bit. Whoever wants to look into the
agent at a moment of a drive gets here what it had before it then.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.base import Agent, Control, Observation
from agents.faults import agents_code, describe
from agents.generators import Generators, generators
from agents.versions import agent_version
from di_envs.route_env import RouteEnv
from leaderboard.records.episode_hash import observation_check
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.recorded_agent import RetraceError, retrace_env, run_agent, run_eyes
from leaderboard.replaying.replay import ReplayError, ReplayStep, replay
from leaderboard.running.episode import close_agent, extra_keys, plan_shown
from wrappers.interventions.context import EditContext, context_of
from wrappers.interventions.eyes import Eyes


@dataclass(frozen=True, kw_only=True)
class Decision:
    """A moment of a drive at which its agent decides, and what it has to decide from.

    Attributes:
        number: How many decisions came before.
        step: The moment. Its world shows the next one once the next decision is asked for.
        shown: What the agent saw: edited as in the run, without what it does not see.
        seen: What it was handed: that, and the world or the town where it may look at them.
        eyes: With which it looked, as they were before it did.
        memory: What it remembered, before it decided.
        control: What it did, as recorded; None where that is not known: at the end of the route,
            where it did nothing, and where it drives on by itself.
        context: The moment, for edits.
    """

    number: int
    step: ReplayStep
    shown: Mapping[str, Any]
    seen: Observation
    eyes: Eyes
    memory: Any
    context: EditContext
    control: Control | None = None

    @property
    def time_s(self) -> float:
        """Game time."""
        return self.step.time_s


def retrace(
    run: RunRecord,
    record: RouteRecord,
    *,
    agent: Agent[Any] | None = None,
    env: RouteEnv | None = None,
) -> Generator[Decision]:
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
        with generators() as drawn:
            yield from _decisions(run, record, driver, env, eyes, checks, drawn)
    finally:
        if agent is None:
            close_agent(driver)


def _decisions(
    run: RunRecord,
    record: RouteRecord,
    agent: Agent[Any],
    env: RouteEnv,
    eyes: Eyes,
    checks: NDArray[np.uint32],
    drawn: Generators,
) -> Iterator[Decision]:
    controls, memory = record.control_array(), None
    dt_s = env.config.control_dt_s
    for step in replay(run, record, env=env):
        if step.decision == 0:
            drawn.begin(record.world_seed)
            memory = _started(agent, env, record)
        control = controls[step.decision] if step.decision < len(controls) else None
        decision, eyes = looked(step, agent, eyes, memory, dt_s, control)
        _check_seen(decision.shown, int(checks[step.decision]), step)
        yield decision
        if control is not None:
            memory = _decided(run, agent, decision.seen, memory, control, step)


def looked(
    step: ReplayStep,
    agent: Agent[Any],
    eyes: Eyes,
    memory: Any,
    control_dt_s: float,
    control: Control | None = None,
) -> tuple[Decision, Eyes]:
    """A moment as an agent sees it that is to decide, and its eyes for the next one."""
    context = context_of(step.info, control_dt_s)
    shown, after = eyes.look(step.observation, context)
    decision = Decision(
        number=step.decision,
        step=step,
        shown=shown,
        seen={**shown, **extra_keys(agent.requires, step.view)},
        eyes=eyes,
        memory=memory,
        context=context,
        control=control,
    )
    return decision, after


def _started(agent: Agent[Any], env: RouteEnv, record: RouteRecord) -> Any:
    """The memory with which the agent begins."""
    try:
        with agents_code():
            return agent.start(plan_shown(agent.requires, env.plan), record.world_seed)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise RetraceError(f"the agent fails at the start: {describe(error)}") from error


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
        with agents_code():
            control, after = agent.act(seen, memory)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
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
