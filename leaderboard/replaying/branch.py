"""Two futures of one moment: a recorded episode goes on from there in a changed world.

The agent drives the recorded part again, as its memory is not in the record; what it sees and what
it does are compared with the record at every decision, so the branch begins where the recorded
episode was, to the bit, or not at all. Then the world is edited, and the agent drives on.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from typing import Any

from agents.base import Agent
from di_envs.edits.world import WorldEdit
from di_envs.route_env import RouteEnv
from di_envs.rules import rules_named
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.going_on import AgentThen, GoingOn
from leaderboard.replaying.recorded_agent import RetraceError, run_agent
from leaderboard.replaying.replay import logged, replay_env, sensor_options
from leaderboard.replaying.retracing import Decision, retrace
from leaderboard.replaying.timed_edits import TimedEdit, decisions_before
from leaderboard.running.episode import close_agent
from leaderboard.running.finished_route import route_record, shown_weather
from leaderboard.running.jobs import Job
from leaderboard.running.log import EpisodeLog


class BranchError(Exception):
    """A moment from which a record cannot be continued; the message says why."""


@dataclass(frozen=True, kw_only=True)
class Branch:
    """Two futures.

    Attributes:
        at_s: Game time up to which they are one.
        edits: What was changed then.
        recorded: The future that was.
        edited: The one that would have been.
    """

    at_s: float
    edits: tuple[WorldEdit, ...]
    recorded: RouteRecord
    edited: RouteRecord


def branch(
    run: RunRecord,
    record: RouteRecord,
    at_s: float,
    edits: Sequence[WorldEdit],
    *,
    on_step: Callable[[float], None] = lambda time_s: None,
) -> Branch:
    """Drives a recorded route on from a moment, in a changed world.

    Args:
        run: The run that the record is of.
        record: The route.
        at_s: Game time; the decisions that were due before it are the recorded ones.
        edits: What is changed then; without any, the recorded future comes out again.
        on_step: Told the game time after every decision.

    Raises:
        BranchError: If there is no such moment, or the agent does not come there as recorded.
        EditError: If an edit cannot be made at that moment, or the record's cannot be read.
        ReplayError: If the run's environment cannot be made here.
    """
    started_s = time.perf_counter()
    with ExitStack() as at_last:
        env = replay_env(run, **sensor_options(run))
        at_last.callback(env.close)
        decisions = _decisions(record, at_s, env.config.control_dt_s)
        try:
            agent = run_agent(run, env)
            at_last.callback(close_agent, agent)
            log, fork = _driven_to(decisions, run, record, agent, env, on_step)
        except RetraceError as error:
            raise BranchError(str(error)) from error
        then = AgentThen(agent=agent, memory=fork.memory, eyes=fork.eyes)
        going = GoingOn(env, record, fork.step, then, edits)
        log = logged(log, going.now.step, going.now.shown)
        while going.decides():
            log = logged(log, going.now.step, going.now.shown)
            on_step(going.now.time_s)
        timed = (str(TimedEdit(edit=edit, time_s=at_s)) for edit in edits)
        edited = route_record(
            env.view,
            Job(index=0, route_id=record.route_id, seed=record.seed),
            rules_named(run.rules),
            log,
            fault=going.fault,
            weather=shown_weather(env),
            interventions=(*record.interventions, *timed),
            wall_s=time.perf_counter() - started_s,
        )
    return Branch(at_s=at_s, edits=tuple(edits), recorded=record, edited=edited)


def _decisions(record: RouteRecord, at_s: float, control_dt_s: float) -> int:
    """How many decisions come before the moment."""
    decisions = decisions_before(at_s, control_dt_s)
    if not 0 <= decisions < record.steps:
        last_s = max(record.steps - 1, 0) * control_dt_s
        raise BranchError(
            f"route {record.route_id}, seed {record.seed} was driven to {record.game_s:g} s: "
            f"branch it between 0 and {last_s:g} s, not at {at_s:g} s"
        )
    return decisions


def _driven_to(
    decisions: int,
    run: RunRecord,
    record: RouteRecord,
    agent: Agent[Any],
    env: RouteEnv,
    on_step: Callable[[float], None],
) -> tuple[EpisodeLog | None, Decision]:
    """The log of the moments before the one after so many decisions, and that moment."""
    log: EpisodeLog | None = None
    with closing(retrace(run, record, agent=agent, env=env)) as retraced:
        for decision in retraced:
            on_step(decision.time_s)
            if decision.number == decisions:
                return log, decision
            log = logged(log, decision.step, decision.shown)
    raise AssertionError("a record has as many moments as it has decisions, and one more")


def branch_run(run: RunRecord, branch: Branch) -> RunRecord:
    """A run of the edited future alone: it can be written, replayed and verified as any other."""
    options = {**run.options, "route_ids": [branch.edited.route_id]}
    return dataclasses.replace(
        run,
        options=options,
        seeds=(branch.edited.seed,),
        planned=1,
        isolated=False,  # it drove on here
        refused={},
        routes=(branch.edited,),
    )


def same_future(one: RouteRecord, other: RouteRecord) -> bool:
    """Whether two drives are the same to the bit, wherever in their runs they stand."""
    return (
        dataclasses.replace(one, index=0).fingerprint()
        == dataclasses.replace(other, index=0).fingerprint()
    )
