"""Asks what if, once its moment comes in a retraced drive, and gathers the future as it was."""

from __future__ import annotations

from collections.abc import Callable

from agents.base import Observation
from di_envs.saving import restore, save
from leaderboard.explaining.explanation import Answer, WhatIf
from leaderboard.explaining.looks import Looking
from leaderboard.records.record import EventRecord
from leaderboard.replaying.film import Film, film_every
from leaderboard.replaying.futures import Future, Moment, drive_on, driver_for
from leaderboard.replaying.retracing import Decision, Eyes, run_eyes
from leaderboard.replaying.what_if import Question
from leaderboard.running.episode import close_agent
from leaderboard.running.log import event_record


class Asking:
    """Answers questions about one moment of a drive.

    Args:
        looking: At the drive.
        questions: All about the same moment.
        at: How many decisions come before it.
        ahead: How many decisions futures are driven on for.
        on_step: Called after every decision of a future.
    """

    def __init__(
        self,
        looking: Looking,
        questions: tuple[Question, ...],
        at: int,
        ahead: int,
        on_step: Callable[[], None],
    ) -> None:
        self._looking, self._questions, self._at, self._ahead = looking, questions, at, ahead
        self._on_step = on_step
        self._eyes = [_eyes_for(question, looking) for question in questions]
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
            self._base = _AsItWas(self._looking, decision)
            self._answers = self._answered(decision)
        elif self._base is not None and decision.number <= self._at + self._ahead:
            self._base.add(decision)

    def what_if(self) -> WhatIf | None:
        """The answers; None if nothing was asked."""
        if self._base is None:
            return None
        return WhatIf(
            at_s=self._base.at_s,
            moment=self._looking.place_of(self._at),
            base=self._base.answer(),
            answers=tuple(self._answers),
        )

    def _answered(self, decision: Decision) -> list[Answer]:
        env = self._looking.env
        moment = Moment(
            run=self._looking.run,
            record=self._looking.record,
            decision=decision,
            snapshot=save(env),
        )
        pairs = zip(self._questions, self._eyes, strict=True)
        answers = [self._answer(moment, question, eyes) for question, eyes in pairs]
        restore(env, moment.snapshot)
        return answers

    def _answer(self, moment: Moment, question: Question, eyes: Eyes) -> Answer:
        looking = self._looking
        driver = driver_for(question, moment, looking.env, looking.agent, eyes)
        try:
            future = drive_on(
                looking.env,
                moment,
                driver,
                question,
                decisions=self._ahead,
                on_step=self._on_step,
            )
            return Answer(
                edit=question.text,
                control=future.controls[0] if len(future.controls) else None,
                look=looking.look(driver.agent, future.seen, moment.decision.memory),
                future=future,
            )
        finally:
            if driver.agent is not looking.agent:
                close_agent(driver.agent)


class _AsItWas:
    """The future that was, taken from the drive as it is retraced."""

    def __init__(self, looking: Looking, decision: Decision) -> None:
        self._looking, self._first, self._last = looking, decision, decision
        self._seen: Observation = decision.seen
        self._memory = decision.memory
        self._film = Film()
        self._film.add(decision.step)
        self._events: list[EventRecord] = []
        self.at_s = decision.time_s

    def add(self, decision: Decision) -> None:
        """Takes up a later moment."""
        step, every = decision.step, film_every(self._looking.env.config.control_dt_s)
        if decision.number % every == 0 or decision.control is None:
            self._film.add(step)
        self._events += [event_record(event, step.view) for event in step.events]
        self._last = decision

    def answer(self) -> Answer:
        """What the agent did, and what came of it."""
        looking, record, last = self._looking, self._looking.record, self._last
        first = self._first.number
        ended = last.control is None
        future = Future(
            seen=self._seen,
            film=self._film,
            controls=record.control_array()[first : last.number],
            checks=record.check_array()[first : last.number + 1],
            events=tuple(self._events),
            end_s=last.time_s,
            status=record.status if ended else "",
            driving_score=float(last.step.info["driving_score"]),
            route_completion=float(last.step.info["route_completion"]),
            problem=record.reason if ended else "",
        )
        return Answer(
            edit="",
            control=self._first.control,
            look=looking.look(looking.agent, self._seen, self._memory),
            future=future,
        )


def _eyes_for(question: Question, looking: Looking) -> Eyes:
    """Eyes that look at the drive from its start, behind the edit."""
    eyes = run_eyes(looking.run, looking.record, looking.env)
    return eyes if question.seen is None else eyes.behind(question.seen)
