"""Futures of a moment of a recorded drive: what is to be seen of each, for so many decisions.

One is the recorded one, taken from the drive as it is retraced; the others are driven on from the
same state (`going_on.py`). Both are gathered in the same way, so they can be laid side by side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agents.base import Control, Observation
from di_envs.edits.world import WorldEdit
from di_envs.route_env import RouteEnv
from di_envs.rules import rules_named
from di_envs.saving import EnvSnapshot, restore
from leaderboard.records.episode_hash import observation_check
from leaderboard.records.record import EventRecord, RouteRecord, RunRecord
from leaderboard.replaying.film import Film, film_every
from leaderboard.replaying.going_on import AgentThen, GoingOn
from leaderboard.replaying.retracing import Decision
from leaderboard.running.log import event_record

AHEAD_S = 15.0  # how far futures are driven, unless somebody says


@dataclass(frozen=True, kw_only=True)
class Fork:
    """The moment from which futures begin.

    Attributes:
        run: The run.
        record: Its route.
        decision: The moment, of a `retrace`.
        snapshot: Of the environment then.
    """

    run: RunRecord
    record: RouteRecord
    decision: Decision
    snapshot: EnvSnapshot


@dataclass(frozen=True, kw_only=True)
class Future:
    """How it went on.

    Attributes:
        seen: What the agent was handed at the moment.
        film: What is to be seen, from the moment on.
        controls: (N, 3) what the agent did.
        checks: (N + 1,) `observation_check` of what it saw before each of them, and at the end.
        events: What happened after the moment.
        end_s: Game time up to which it was driven.
        status: How the route ended, in CARLA's words; empty if it goes on.
        driving_score: At the end.
        route_completion: At the end, percent.
        problem: Why the agent drove no further; empty if it could.
    """

    seen: Observation
    film: Film
    controls: NDArray[np.float32]
    checks: NDArray[np.uint32]
    events: tuple[EventRecord, ...]
    end_s: float
    status: str
    driving_score: float
    route_completion: float
    problem: str = ""


class FutureSoFar:
    """Gathers a future, moment by moment.

    Args:
        first: The moment at which it begins.
        control_dt_s: Time from one decision to the next.
    """

    def __init__(self, first: Decision, control_dt_s: float) -> None:
        self._first = self._last = first
        self._every = film_every(control_dt_s)
        self._film = Film()
        self._film.add(first.step)
        self._controls: list[Control] = []
        self._checks = [observation_check(first.shown)]
        self.events: list[EventRecord] = []

    def add(self, decision: Decision, *, last: bool = False) -> None:
        """Takes up the next moment; the last one of a drive is always filmed."""
        step = decision.step
        assert step.control is not None
        if decision.number % self._every == 0 or last:
            self._film.add(step)
        self._controls.append(step.control)
        self._checks.append(observation_check(decision.shown))
        self.events += [event_record(event, step.view) for event in step.events]
        self._last = decision

    def future(self, status: str, problem: str) -> Future:
        """What has become of it."""
        last = self._last.step
        return Future(
            seen=self._first.seen,
            film=self._film,
            controls=np.array(self._controls, np.float32).reshape(-1, 3),
            checks=np.array(self._checks, np.uint32),
            events=tuple(self.events),
            end_s=last.time_s,
            status=status,
            driving_score=float(last.info["driving_score"]),
            route_completion=float(last.info["route_completion"]),
            problem=problem,
        )


def drive_on(
    env: RouteEnv,
    fork: Fork,
    then: AgentThen,
    edits: Sequence[WorldEdit] = (),
    *,
    decisions: int,
    on_step: Callable[[], None] = lambda: None,
) -> Future:
    """Drives on from a moment.

    Args:
        env: The environment that the moment is of, or a twin; it is left somewhere in the future.
        fork: The moment.
        then: Who drives on.
        edits: What is edited of the world.
        decisions: At most so many.
        on_step: Called after every decision.

    Raises:
        EditError: If the world cannot be edited so at that moment.
    """
    restore(env, fork.snapshot)
    going = GoingOn(env, fork.record, fork.decision.step, then, edits)
    so_far = FutureSoFar(going.now, env.config.control_dt_s)
    for _ in range(decisions):
        if not going.decides():
            break
        so_far.add(going.now, last=going.now.step.over)
        on_step()
    status = _status(fork, so_far.events) if going.now.step.over else ""
    return so_far.future(status, going.fault[1])


def _status(fork: Fork, events: Sequence[EventRecord]) -> str:
    """How the route ended, by the rules."""
    now_s = fork.decision.time_s
    before = [event.kind for event in fork.record.events if event.time_s <= now_s]
    rules = rules_named(fork.run.rules)
    return rules.status([*before, *(event.kind for event in events)])
