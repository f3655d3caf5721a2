"""One run under two rule sets as a terminal table."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.table import Table

from di_envs.files.shown_text import in_one_line
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.studies.comparing import SCORES


def rescoring_table(run: RunRecord, other: RunRecord) -> Table:
    """The routes of one run under two rule sets, side by side, and their means."""
    table = Table(
        title=in_one_line(f"{run.agent} on {run.suite} · {run.rules} and {other.rules}"),
        title_justify="left",
        title_style="bold",
    )
    table.add_column("route")
    table.add_column("seed", justify="right")
    for rules in (run.rules, other.rules):
        for name in ("DS", "RC", "IS"):
            table.add_column(f"{name}\n{rules.removeprefix('carla-')}", justify="right")
    table.add_column("change of DS", justify="right")
    pairs = list(zip(run.scored, other.scored, strict=True))
    for ours, theirs in pairs:
        change = theirs.score.driving_score - ours.score.driving_score
        table.add_row(
            ours.route_id,
            str(ours.seed),
            *_score_cells([ours]),
            *_score_cells([theirs]),
            f"{change:+.1f}" if change else "",
        )
    table.add_section()
    change = math.fsum(b.score.driving_score - a.score.driving_score for a, b in pairs)
    table.add_row(
        "mean",
        "",
        *_score_cells(run.scored),
        *_score_cells(other.scored),
        f"{change / len(pairs) + 0.0:+.2f}",
        style="bold",
    )
    return table


def _score_cells(records: Sequence[RouteRecord]) -> list[str]:
    count = len(records)
    means = [math.fsum(getattr(r.score, name) for r in records) / count for name in SCORES]
    return [f"{means[0]:.1f}", f"{means[1]:.1f}", f"{means[2]:.3f}"]
