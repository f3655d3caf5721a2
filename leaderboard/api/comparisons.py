"""`compare`: two runs paired by route and seed, as a value."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from leaderboard.api.requests import requests
from leaderboard.api.runs import Run, load_run
from leaderboard.api.shown import Shown
from leaderboard.studies.comparing import Comparison


@dataclass(frozen=True, kw_only=True, repr=False)
class Compared(Shown):
    """What the second of two runs changed.

    Attributes:
        comparison: The pairs, with intervals and events.
    """

    comparison: Comparison

    @property
    def difference(self) -> float:
        """By how much the driving score rose, the mean over all pairs."""
        return self.comparison.interval("driving_score").value

    @property
    def title(self) -> str:
        """Who against whom, the difference, and how surely."""
        found, pairs = self.comparison.interval("driving_score"), self.comparison.pairs
        doubt = "" if found.low is None else f" [{found.low:+.1f}, {found.high:+.1f}]"
        return (
            f"{self.comparison.after.title} less {self.comparison.before.title}: "
            f"DS {found.value:+.1f}{doubt}, {len(pairs)} pairs"
        )

    def rows(self) -> list[dict[str, Any]]:
        """A row for each pair."""
        return [
            {
                "route": pair.before.route_id,
                "seed": pair.before.seed,
                "before": pair.before.score.driving_score,
                "after": pair.after.score.driving_score,
                "difference": pair.difference,
                "same_episode": pair.same_episode,
            }
            for pair in self.comparison.pairs
        ]


def compare(
    first: Run | Path | str, second: Run | Path | str, rules: str | None = None
) -> Compared:
    """Pairs two runs of the same worlds by route and seed.

    Args:
        first: A run, or its folder.
        second: Another; differences are this one less the first.
        rules: Score both by these first; None for their own.

    Raises:
        RequestError: If they cannot be paired, with the reason.
    """
    from di_envs.rules import rules_named
    from leaderboard.records.rescoring import rescored
    from leaderboard.studies.comparing import compare_runs

    with requests():
        records = [as_run(run).record for run in (first, second)]
        if rules is not None:
            records = [rescored(record, rules_named(rules)) for record in records]
        return Compared(comparison=compare_runs(*records))


def as_run(run: Run | Path | str, *, trust: bool = False) -> Run:
    """A run, or that of a folder."""
    return run if isinstance(run, Run) else load_run(run, trust=trust)
