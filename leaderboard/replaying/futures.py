"""How a drive goes on from a moment, with or without an edit: futures that begin at the same state.

The environment is put back to where it was, and the agent has the memory that it had, to the bit;
so what differs between two futures does so because of the edit. An agent that hides its memory
drives the recorded part again for each of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.base import Agent, Control, Observation
from di_envs.edits.world import apply_world_edits
from di_envs.route_env import RouteEnv
from di_envs.rules import rules_named
from di_envs.saving import EnvSnapshot, restore
from di_envs.world.state import TICK_S
from leaderboard.records.episode_hash import observation_check
from leaderboard.records.record import EventRecord, RouteRecord, RunRecord
from leaderboard.replaying.film import Film, film_every
from leaderboard.replaying.replay import ReplayStep
from leaderboard.replaying.retracing import Decision, Eyes, retrace
from leaderboard.replaying.timed_edits import EditPlan, timed_edits
from leaderboard.replaying.what_if import Question
from leaderboard.running.episode import control_error, describe, extra_keys
from leaderboard.running.log import event_record
from wrappers.interventions.context import context_of

AHEAD_S = 15.0  # how far futures are driven, unless somebody says


@dataclass(frozen=True, kw_only=True)
class Moment:
    """From where futures begin.

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
class Driver:
    """Who drives on.

    Attributes:
        agent: The agent.
        memory: What it remembered at the moment.
        eyes: With which it looks then.
    """

    agent: Agent[Any]
    memory: Any
    eyes: Eyes


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


def drive_on(
    env: RouteEnv,
    moment: Moment,
    driver: Driver,
    question: Question | None = None,
    *,
    decisions: int,
    on_step: Callable[[], None] = lambda: None,
) -> Future:
    """Drives on from a moment.

    Args:
        env: The environment that the moment is of, or a twin; it is left somewhere in the future.
        moment: The moment.
        driver: Who drives on, as the question wants it; see `driver_for`.
        question: What is edited of the world; None for nothing.
        decisions: At most so many.
        on_step: Called after every decision.

    Raises:
        EditError: If the world cannot be edited so at that moment.
    """
    restore(env, moment.snapshot)
    if question is not None and question.world is not None:
        apply_world_edits(env, (question.world,))
    going = _Going(env, moment, driver)
    last = moment.decision.number + decisions
    while going.number < last and going.decides():
        on_step()
    return going.future()


def driver_for(
    question: Question,
    moment: Moment,
    env: RouteEnv,
    agent: Agent[Any],
    eyes: Eyes,
) -> Driver:
    """Who drives on with an edit: the agent itself, where it can, or one like it.

    Args:
        question: The edit.
        moment: The moment.
        env: The environment that it is of, or a twin.
        agent: That retraces the drive.
        eyes: That have looked at the drive so far, behind the edit.

    Returns:
        The driver; its agent is to be closed by the caller if it is another one.
    """
    if not agent.requires.branchable:
        other = question.interventions.agent(moment.run.agent)
        return Driver(agent=other, memory=_memory_of(other, moment, env), eyes=eyes)
    if question.within:
        agent = question.interventions.agent(moment.run.agent)
    return Driver(agent=agent, memory=moment.decision.memory, eyes=eyes)


def _memory_of(agent: Agent[Any], moment: Moment, env: RouteEnv) -> Any:
    """The memory of an agent that hides it, once it has driven to the moment itself."""
    decisions = retrace(moment.run, moment.record, agent=agent, env=env.twin())
    return next(d.memory for d in decisions if d.number == moment.decision.number)


class _Going:
    """A future while it is driven."""

    def __init__(self, env: RouteEnv, moment: Moment, driver: Driver) -> None:
        self._env, self._moment = env, moment
        self._agent, self._memory, self._eyes = driver.agent, driver.memory, driver.eyes
        plan = timed_edits(moment.record.interventions)
        self._later = EditPlan(plan, env.config.control_dt_s)
        self._every = film_every(env.config.control_dt_s)
        self._film = Film()
        self._controls: list[Control] = []
        self._checks: list[int] = []
        self._events: list[EventRecord] = []
        self._problem = ""
        step = moment.decision.step
        self.number, self._over = step.decision, step.over
        self._info: Mapping[str, Any] = step.info
        self._seen = self.first = self._look(env.observe(), step.control)

    def decides(self) -> bool:
        """One decision, and what it leads to; False where there is none to make."""
        if self._over:
            return False
        try:
            control, memory = self._agent.act(self._seen, self._memory)
        except (Exception, SystemExit) as error:
            self._problem = describe(error)
            return False
        control = np.asarray(control, np.float32)
        self._problem = control_error(control)
        if self._problem:
            return False
        self._memory = memory
        observation, _, terminated, truncated, self._info = self._env.step(control)
        self._over = terminated or truncated
        self.number += 1
        if self._later.apply(self._env, self.number):  # what was done to the recorded world too
            observation = self._env.observe()
        self._controls.append(control)
        self._events += [event_record(event, self._env.view) for event in self._info["events"]]
        self._seen = self._look(observation, control)
        return True

    def _look(self, observation: Mapping[str, Any], control: Control | None) -> Observation:
        """What the agent is handed; films the moment."""
        context = context_of(self._info, self._env.config.control_dt_s)
        shown, self._eyes = self._eyes.look(observation, context)
        self._checks.append(observation_check(shown))
        if not self._controls or self.number % self._every == 0 or self._over:
            self._film.add(
                ReplayStep(
                    decision=self.number,
                    time_s=self._info["game_time_s"],
                    control=control,
                    observation=observation,
                    view=self._env.view,
                    events=self._info["events"],
                    reward=0.0,
                    info=self._info,
                    over=self._over,
                )
            )
        return {**shown, **extra_keys(self._agent.requires, self._env.view)}

    def future(self) -> Future:
        """What has become of it."""
        run, record = self._moment.run, self._moment.record
        now_s = self._moment.decision.time_s
        before = [event.kind for event in record.events if event.time_s <= now_s]
        kinds = [*before, *(event.kind for event in self._events)]
        return Future(
            seen=self.first,
            film=self._film,
            controls=np.array(self._controls, np.float32).reshape(-1, 3),
            checks=np.array(self._checks, np.uint32),
            events=tuple(self._events),
            end_s=round(int(self._env.view.state.tick) * TICK_S, 6),
            status=rules_named(run.rules).status(kinds) if self._over else "",
            driving_score=float(self._info["driving_score"]),
            route_completion=float(self._info["route_completion"]),
            problem=self._problem,
        )
