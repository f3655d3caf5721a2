"""What came of each edit, as a table that can be read without script."""

from __future__ import annotations

import math

import numpy as np

from di_envs.rules import rules_named
from leaderboard.explaining.explanation import Answer, WhatIf
from leaderboard.pages.markup import Cell, Heading, Markup, TableOf
from leaderboard.pages.report_tables import event_text
from leaderboard.records.record import EventRecord, RunRecord
from leaderboard.replaying.futures import Future

_HEADINGS = (
    Heading(name="edit"),
    Heading(name="throttle", number=True, note="at the moment"),
    Heading(name="steer", number=True, note="at the moment; positive is right"),
    Heading(name="brake", number=True, note="at the moment"),
    Heading(
        name="path moves",
        number=True,
        note="the largest distance between a predicted waypoint and the same one without the edit",
    ),
    Heading(name="last waypoint", number=True, note="ahead and to the right of the ego"),
    Heading(name="score", number=True, note="driving score at the end of what was driven"),
    Heading(name="route done", number=True),
    Heading(name="what happened then"),
)
_NONE = "\N{EN DASH}"


def answers_table(what_if: WhatIf, run: RunRecord) -> Markup:
    """A row for the drive as it was, and one for each edit."""
    rows = [_row(answer, what_if.base, run) for answer in (what_if.base, *what_if.answers)]
    return TableOf(id="answers", headings=_HEADINGS, rows=rows).markup()


def path_moves_m(answer: Answer, base: Answer) -> float:
    """The largest distance between predicted waypoints with and without the edit; NaN for none."""
    if answer.look is None or base.look is None:
        return math.nan
    apart = answer.look.response.waypoints - base.look.response.waypoints
    return float(np.linalg.norm(apart, axis=1).max(initial=0.0))


def _row(answer: Answer, base: Answer, run: RunRecord) -> tuple[Cell, ...]:
    future = answer.future
    control = [math.nan] * 3 if answer.control is None else answer.control.tolist()
    return (
        Cell(shows=answer.edit or "as it was"),
        *(_number(value, ".2f") for value in control),
        _number(path_moves_m(answer, base), ".2f", " m"),
        _last_waypoint(answer),
        _number(future.driving_score, ".1f"),
        _number(future.route_completion, ".1f", " %"),
        Cell(shows=_what_happened(future, run)),
    )


def _number(value: float, form: str, unit: str = "") -> Cell:
    if math.isnan(value):
        return Cell(shows=_NONE, sort=-math.inf)
    return Cell(shows=f"{value:{form}}{unit}", sort=value)


def _last_waypoint(answer: Answer) -> Cell:
    if answer.look is None:
        return Cell(shows=_NONE, sort=-math.inf)
    x, y = answer.look.response.waypoints[-1].tolist()
    return Cell(shows=f"{x:.1f} m, {y:+.1f} m", sort=x)


def telling_events(future: Future, run: RunRecord) -> list[EventRecord]:
    """The events that count in the score, or end the route."""
    rules = rules_named(run.rules)
    kinds = {*rules.infractions, *rules.endings}
    return [event for event in future.events if event.kind in kinds]


def _what_happened(future: Future, run: RunRecord) -> str:
    events = [f"{event_text(event)} at {event.time_s:g} s" for event in telling_events(future, run)]
    ends = future.status or f"driven to {future.end_s:g} s"
    if future.problem:
        ends = f"{ends}: {future.problem}"
    return "; ".join((*events, ends))
