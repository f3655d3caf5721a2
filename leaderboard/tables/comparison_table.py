"""A comparison of two runs as terminal tables."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.console import Group
from rich.table import Table
from rich.text import Text

from di_envs.files.shown_text import in_one_line
from leaderboard.records.record import EventRecord
from leaderboard.scoring.names import EVENT_NAMES
from leaderboard.statistics.bootstrap import FEW_ROUTES, BootstrapInterval
from leaderboard.studies.comparing import SCORES, Comparison, Pair
from leaderboard.tables.run_tables import plain_status

_NAMES = {"driving_score": "DS", "route_completion": "RC", "infraction_score": "IS"}
_DECIMALS = {"driving_score": 2, "route_completion": 2, "infraction_score": 3}


def comparison_tables(comparison: Comparison) -> Group:
    """Mean differences with their intervals, then the routes that changed and why."""
    changes = comparison.changes()
    parts: list[Table | Text] = [_score_table(comparison)]
    if changes:
        parts.append(_change_table(changes))
    return Group(*parts, Text(_caption(comparison, len(changes)), style="dim"))


def _score_table(comparison: Comparison) -> Table:
    before, after = comparison.before, comparison.after
    title = f"{before.title} and {after.title} on {before.suite} · rules {before.rules}"
    table = Table(
        title=in_one_line(title),
        title_justify="left",
        title_style="bold",
    )
    table.add_column("")
    for name in ("first", "second", "difference", "95 % interval"):
        table.add_column(name, justify="right", no_wrap=True)
    for score in SCORES:
        ours = [getattr(pair.before.score, score) for pair in comparison.pairs]
        theirs = [getattr(pair.after.score, score) for pair in comparison.pairs]
        digits, interval = _DECIMALS[score], comparison.interval(score)
        table.add_row(
            _NAMES[score],
            f"{math.fsum(ours) / len(ours):.{digits}f}",
            f"{math.fsum(theirs) / len(theirs):.{digits}f}",
            f"{interval.value + 0.0:+.{digits}f}",
            _interval_text(interval, digits),
            style="bold" if interval.clear else None,
        )
    return table


def _interval_text(interval: BootstrapInterval, digits: int) -> str:
    if interval.low is None or interval.high is None:
        return "-"
    return f"{interval.low + 0.0:+.{digits}f} … {interval.high + 0.0:+.{digits}f}"


def _change_table(changes: Sequence[Pair]) -> Table:
    table = Table(
        title="what changed: DS of routes, and the events that are gone or new",
        title_justify="left",
        title_style="bold",
    )
    table.add_column("route")
    for name in ("seed", "first", "second", "change"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("by", overflow="fold")
    for pair in changes:
        table.add_row(
            pair.before.route_id,
            str(pair.before.seed),
            f"{pair.before.score.driving_score:.1f}",
            f"{pair.after.score.driving_score:.1f}",
            f"{pair.difference:+.1f}",
            _reasons(pair),
        )
    return table


def _reasons(pair: Pair) -> str:
    """`no longer: red light (12.3 s); new: vehicle hit (40.0 s)`, or how far it came."""
    parts = []
    if pair.gone:
        parts.append(f"no longer: {', '.join(map(_event_text, pair.gone))}")
    if pair.new:
        parts.append(f"new: {', '.join(map(_event_text, pair.new))}")
    if pair.before.crashed != pair.after.crashed:
        parts.append(f"{plain_status(pair.before.status)}, then {plain_status(pair.after.status)}")
    if not parts:
        before, after = pair.before.score, pair.after.score
        if before.route_completion != after.route_completion:
            parts.append(
                f"route completion {before.route_completion:.1f}, then {after.route_completion:.1f}"
            )
        else:
            parts.append("the same events, of another size")
    return "; ".join(parts)


def _event_text(event: EventRecord) -> str:
    return f"{EVENT_NAMES[event.kind]} ({event.time_s:.1f} s)"


def _caption(comparison: Comparison, changed: int) -> str:
    pairs, routes = len(comparison.pairs), comparison.routes
    same = sum(pair.same_episode for pair in comparison.pairs)
    lines = [
        f"{pairs} pairs of route and seed over {routes} distinct routes; {changed} changed, "
        f"{same} are the same episode to the bit.",
        "Differences are second less first; intervals: bootstrap over distinct routes.",
    ]
    if routes == 1:
        lines.append("One route: nothing can be said of others.")
    elif routes < FEW_ROUTES:
        lines.append(f"With {routes} routes the intervals are likely too narrow.")
    if comparison.lost:
        lines.append(f"Left out: {comparison.lost} that the machinery lost in a run.")
    if comparison.unpaired:
        lines.append(f"Left out: {comparison.unpaired} that only one run has.")
    return "\n".join(lines)
