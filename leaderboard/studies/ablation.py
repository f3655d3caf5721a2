"""An ablation worked out: each row's effect, which infractions it brings, the paper beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from di_envs.rules import rules_named
from di_envs.world.event_names import EVENT_KEYS
from di_envs.world.kinds import EventKind
from leaderboard.scoring.score import infractions_per_km
from leaderboard.statistics.bootstrap import expanded_interval
from leaderboard.statistics.rank_correlation import spearman
from leaderboard.studies import StudyError
from leaderboard.studies.effects import (
    ALPHA,
    EQUIVALENT,
    MARGIN_DS,
    MATTERS,
    Effect,
    effect,
)
from leaderboard.studies.record import DrivenRow, Study, StudyDrive
from leaderboard.studies.rows import NULL, WAYS
from leaderboard.studies.table_two import TABLE_2

Pairs = Sequence[tuple[StudyDrive, StudyDrive]]  # without the edit, and with it


@dataclass(frozen=True, kw_only=True)
class RowFinding:
    """A row against the baseline, over the worlds that both drove.

    Attributes:
        driven: The row.
        driving_score: Its mean, over these worlds; so the other two.
        difference: Of the driving score.
        completion_difference: Mean difference of the route completion.
        penalty_difference: … of the infraction score.
        per_km: Difference of infractions per km driven, by kind; without zeros.
        same: How many drives are the same to the bit.
        changed_routes: How many distinct routes are not.
    """

    driven: DrivenRow
    driving_score: float
    route_completion: float
    infraction_score: float
    difference: Effect
    completion_difference: float
    penalty_difference: float
    per_km: Mapping[str, float]
    same: int
    changed_routes: int

    @property
    def verdict(self) -> str:
        return self.difference.verdict

    @property
    def paper_difference(self) -> float | None:
        """Of the paper's driving score, for the same component."""
        row = TABLE_2.get(self.driven.row.component)
        return None if row is None else row.difference

    @property
    def judged_otherwise_in_paper(self) -> bool:
        """Whether both have a verdict, and not the same one."""
        row = TABLE_2.get(self.driven.row.component)
        return row is not None and {self.verdict, row.verdict} == {MATTERS, EQUIVALENT}

    @property
    def outside(self) -> bool:
        """Whether the paper's difference is not in the interval, nor near what was found."""
        there, found = self.paper_difference, self.difference
        if there is None or found.low is None or found.high is None:
            return False
        return not found.low <= there <= found.high and abs(there - found.mean) > MARGIN_DS


@dataclass(frozen=True, kw_only=True)
class Correlation:
    """How alike the order of differences is here and in the paper.

    Attributes:
        group: `drop` or `zero`.
        rho: Spearman's; None where it cannot be worked out.
        low: Of its 95 % interval over routes; None likewise.
        high: Its other end.
        rows: How many components.
    """

    group: str
    rho: float | None
    low: float | None
    high: float | None
    rows: int


@dataclass(frozen=True, kw_only=True)
class Ablation:
    """A study worked out.

    Attributes:
        study: The study.
        tests: For how many rows the intervals are corrected.
        rows: Findings of the rows that have pairs with the baseline.
        correlations: With the paper, a group each.
    """

    study: Study
    tests: int
    rows: tuple[RowFinding, ...]
    correlations: tuple[Correlation, ...]

    @property
    def routes(self) -> int:
        """How many distinct routes the baseline drove."""
        return len({drive.route_hash for drive in self.study.baseline.drives})


def work_out(study: Study) -> Ablation:
    """Works a study out; rows without a pair yet are left out.

    Raises:
        StudyError: If its null row is not the baseline.
    """
    for before, after in paired(study.baseline, study.row(NULL)):
        if before.episode != after.episode or before.driving_score != after.driving_score:
            raise StudyError(
                f"the null row of this record is not its baseline on route {before.route_id}, seed "
                f"{before.seed}: its numbers are not of one agent that drives the same way twice"
            )
    tests = max(len(study.compared), 1)
    rows = tuple(
        _finding(driven, pairs, study, tests)
        for driven in study.compared
        if (pairs := paired(study.baseline, driven))
    )
    groups = [(way, [row for row in rows if row.driven.row.group == way]) for way in WAYS]
    return Ablation(
        study=study,
        tests=tests,
        rows=rows,
        correlations=tuple(_correlation(way, found) for way, found in groups if found),
    )


def paired(baseline: DrivenRow, driven: DrivenRow) -> Pairs:
    """The worlds that both drove, in the baseline's order."""
    theirs = driven.by_world()
    return [
        (drive, theirs[world]) for world, drive in baseline.by_world().items() if world in theirs
    ]


def _finding(driven: DrivenRow, pairs: Pairs, study: Study, tests: int) -> RowFinding:
    changed = [before for before, after in pairs if before.episode != after.episode]
    return RowFinding(
        driven=driven,
        driving_score=_mean([after.driving_score for _, after in pairs]),
        route_completion=_mean([after.route_completion for _, after in pairs]),
        infraction_score=_mean([after.infraction_score for _, after in pairs]),
        difference=effect(
            [after.driving_score - before.driving_score for before, after in pairs],
            [before.route_hash for before, _ in pairs],
            tests=tests,
        ),
        completion_difference=_mean([b.route_completion - a.route_completion for a, b in pairs]),
        penalty_difference=_mean([b.infraction_score - a.infraction_score for a, b in pairs]),
        per_km=_per_km(pairs, study.rules),
        same=len(pairs) - len(changed),
        changed_routes=len({drive.route_hash for drive in changed}),
    )


def _per_km(pairs: Pairs, rules: str) -> dict[str, float]:
    found = {}
    for kind in rules_named(rules).infractions:
        before, after = (_rate([pair[side] for pair in pairs], kind) for side in (0, 1))
        if after != before:
            found[EVENT_KEYS[kind]] = after - before
    return found


def _rate(drives: Sequence[StudyDrive], kind: EventKind) -> float:
    count = sum(drive.events.get(EVENT_KEYS[kind], 0) for drive in drives)
    return infractions_per_km(count, math.fsum(drive.done_m for drive in drives))


def _correlation(way: str, rows: Sequence[RowFinding]) -> Correlation:
    rows = [row for row in rows if row.paper_difference is not None]
    theirs = [row.paper_difference or 0.0 for row in rows]
    rho = spearman([row.difference.mean for row in rows], theirs)
    low = high = None
    resampled = [row.difference.means for row in rows]
    alike = len({(row.difference.pairs, row.difference.routes) for row in rows}) == 1
    if rho is not None and alike and all(means is not None for means in resampled):
        columns = np.stack(resampled, axis=1)[:: len(resampled[0]) // 2000]  # type: ignore[arg-type]
        draws = [spearman(list(ours), theirs) for ours in columns]
        known = np.array([each for each in draws if each is not None])
        if len(known) > len(draws) // 2:
            low, high = expanded_interval(known, rows[0].difference.routes, ALPHA / 2.0)
    return Correlation(group=way, rho=rho, low=low, high=high, rows=len(rows))


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values)
