"""Answers what if, once its moment comes in a retraced drive, and gathers the future as it was."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from agents.base import Agent
from di_envs.route_env import RouteEnv
from di_envs.saving import restore, save
from leaderboard.explaining.explanation import Answer, WhatIf
from leaderboard.explaining.looks import DriveLooks
from leaderboard.explaining.questions import Question
from leaderboard.replaying.futures import Fork, FutureSoFar, drive_on
from leaderboard.replaying.going_on import AgentThen
from leaderboard.replaying.recorded_agent import run_eyes
from leaderboard.replaying.retracing import Decision, retrace
from leaderboard.running.episode import close_agent
from wrappers.interventions.eyes import Eyes


class Answering:
    """Answers questions about one moment of a drive.

    Args:
        looks: At the drive.
        questions: All about the same moment.
        at: How many decisions come before it.
        ahead: How many decisions futures are driven on for.
        on_step: Called after every decision of a future.
    """

    def __init__(
        self,
        looks: DriveLooks,
        questions: tuple[Question, ...],
        at: int,
        ahead: int,
        on_step: Callable[[], None],
    ) -> None:
        self._looks, self._questions, self._at, self._ahead = looks, questions, at, ahead
        self._on_step = on_step
        self._eyes = [_eyes_for(question, looks) for question in questions]
        self._answers: list[Answer] = []
        self._base: _AsItWas | None = None

    def add(self, decision: Decision) -> None:
        """Takes up a moment of the drive, and answers if it is the one."""
        if not self._questions:
            return
        if decision.number < self._at:
            seen = decision.step.observation, decision.context
            self._eyes = [eyes.look(*seen)[1] for eyes in self._eyes]
        if decision.number == self._at:
            self._base = _AsItWas(self._looks, decision)
            self._answers = self._answered(decision)
        elif self._base is not None and decision.number <= self._at + self._ahead:
            self._base.add(decision)

    def what_if(self) -> WhatIf | None:
        """The answers; None if nothing was asked."""
        if self._base is None:
            return None
        return WhatIf(
            at_s=self._base.at_s,
            moment=self._looks.place_of(self._at),
            base=self._base.answer(),
            answers=tuple(self._answers),
        )

    def _answered(self, decision: Decision) -> list[Answer]:
        looks = self._looks
        fork = Fork(run=looks.run, record=looks.record, decision=decision, snapshot=save(looks.env))
        pairs = zip(self._questions, self._eyes, strict=True)
        answers = [self._answer(fork, question, eyes) for question, eyes in pairs]
        restore(looks.env, fork.snapshot)
        return answers

    def _answer(self, fork: Fork, question: Question, eyes: Eyes) -> Answer:
        looks = self._looks
        then = _agent_then(question, fork, looks.env, looks.agent, eyes)
        try:
            future = drive_on(
                looks.env,
                fork,
                then,
                () if question.world is None else (question.world,),
                decisions=self._ahead,
                on_step=self._on_step,
            )
            return Answer(
                edit=question.text,
                control=future.controls[0] if len(future.controls) else None,
                look=looks.look(then.agent, future.seen, fork.decision.memory),
                future=future,
            )
        finally:
            if then.agent is not looks.agent:
                close_agent(then.agent)


class _AsItWas:
    """The future that was, taken from the drive as it is retraced."""

    def __init__(self, looks: DriveLooks, first: Decision) -> None:
        self._looks, self._first, self._ended = looks, first, False
        self._so_far = FutureSoFar(first, looks.env.config.control_dt_s)
        self.at_s = first.time_s

    def add(self, decision: Decision) -> None:
        """Takes up a later moment."""
        self._ended = decision.control is None
        self._so_far.add(decision, last=self._ended)

    def answer(self) -> Answer:
        """What the agent did, and what came of it."""
        looks, first = self._looks, self._first
        ending = (looks.record.status, looks.record.reason) if self._ended else ("", "")
        return Answer(
            edit="",
            control=first.control,
            look=looks.look(looks.agent, first.seen, first.memory),
            future=self._so_far.future(*ending),
        )


def _eyes_for(question: Question, looks: DriveLooks) -> Eyes:
    """Eyes that look at the drive from its start, behind the edit."""
    eyes = run_eyes(looks.run, looks.record, looks.env)
    return eyes if question.seen is None else eyes.behind(question.seen)


def _agent_then(
    question: Question, fork: Fork, env: RouteEnv, agent: Agent[Any], eyes: Eyes
) -> AgentThen:
    """Who drives on with an edit: the agent that retraces the drive, or another one like it.

    Another one is to be closed by the caller.
    """
    if not agent.requires.branchable:
        other = question.interventions.agent(fork.run.agent)
        return AgentThen(agent=other, memory=_memory_of(other, fork, env), eyes=eyes)
    if question.within:
        agent = question.interventions.agent(fork.run.agent)
    return AgentThen(agent=agent, memory=fork.decision.memory, eyes=eyes)


def _memory_of(agent: Agent[Any], fork: Fork, env: RouteEnv) -> Any:
    """The memory of an agent that hides it, once it has driven to the moment itself."""
    decisions = retrace(fork.run, fork.record, agent=agent, env=env.twin())
    return next(d.memory for d in decisions if d.number == fork.decision.number)
