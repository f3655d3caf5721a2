"""What stands below the tables of an ablation: how to read them, and what limits them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from leaderboard.records.claim_text import NOT_ISOLATED, in_reach
from leaderboard.statistics.bootstrap import FEW_ROUTES
from leaderboard.studies.ablation import Ablation, Correlation
from leaderboard.studies.effects import ALPHA, MARGIN_DS, POWER
from leaderboard.studies.record import Study
from leaderboard.studies.rows import BASELINE
from leaderboard.tables.ablation_cells import has_paper, mean_of, time_text

_LOW_DS = 4.0 * MARGIN_DS  # a baseline below that cannot fall by much


def notes(ablation: Ablation) -> list[str]:
    """All that applies, a line each."""
    return [
        *([NOT_ISOLATED] if in_reach(ablation.study) else []),
        *_how_to_read(ablation),
        *_of_the_paper(ablation),
        *_of_a_low_baseline(ablation.study),
        *_of_correlations(ablation.correlations),
        *_of_equal_drives(ablation),
        *_of_few_routes(ablation.routes),
        *_of_what_is_missing(ablation.study),
        _how_long(ablation.study),
    ]


def _how_to_read(ablation: Ablation) -> Iterator[str]:
    yield (
        "Differences are to the baseline in the same worlds (route and seed). Intervals: bootstrap "
        f"over {ablation.routes} distinct routes, each with its seeds; all {ablation.tests} hold "
        f"together with {100 * (1 - ALPHA):.0f} % (Bonferroni)."
    )
    yield (
        "matters: the interval excludes 0. equivalent: two one-sided tests say within "
        f"±{MARGIN_DS:g} DS. could see: the effect that would have been found with "
        f"{100 * POWER:.0f} % probability ('-': nothing varied)."
    )


def _of_the_paper(ablation: Ablation) -> Iterator[str]:
    if has_paper(ablation):
        yield (
            "paper: difference of DS in Table 2 of Li et al., 2024; its model had Town05 in "
            "training, the shipped policy had not; its rows have no interval."
        )


def _of_a_low_baseline(study: Study) -> Iterator[str]:
    score = mean_of(study.baseline, "driving_score")
    if score is not None and score < _LOW_DS:
        yield (
            f"The baseline's DS is {score:.1f}: no row can fall by more, so 'equivalent' says "
            "little of what such an agent uses."
        )


def _of_correlations(correlations: Sequence[Correlation]) -> Iterator[str]:
    for each in correlations:
        if each.rho is None:
            continue
        span = ""
        if each.low is not None and each.high is not None:
            span = f" ({each.low:+.2f} … {each.high:+.2f})"
        yield (
            f"Spearman's rank correlation with the paper, {each.group} rows: {each.rho:+.2f}{span} "
            f"over {each.rows} components."
        )


def _of_equal_drives(ablation: Ablation) -> Iterator[str]:
    """The rule of three: of n routes without a change, up to 3 / n may still change."""
    if any(row.changed_routes == 0 for row in ablation.rows):
        share = min(3.0 / max(ablation.routes, 1), 1.0)
        yield (
            "Where all drives are the same, the interval is 0 … 0 for these routes; of all routes "
            f"like them up to {100 * share:.0f} % may still change (rule of three)."
        )


def _of_few_routes(routes: int) -> Iterator[str]:
    if routes == 1:
        yield "One route: there are no intervals, and nothing can be said of others."
    elif 1 < routes < FEW_ROUTES:
        yield f"With {routes} routes the intervals are likely too narrow."


def _of_what_is_missing(study: Study) -> Iterator[str]:
    """Rows left out, not finished, or without some drives."""
    for driven in study.left_out:
        yield f"Left out: {driven.row.name}: {driven.left_out}."
    for driven in study.rows:
        if not driven.left_out and not driven.complete and driven.row.name != BASELINE:
            yield (
                f"Not complete: {driven.row.name}: {len(driven.drives)} of {driven.planned} drives."
            )


def _how_long(study: Study) -> str:
    wall_s = sum(driven.wall_s for driven in study.rows)
    return f"Driven in {time_text(wall_s)} of wall-clock time, added up over processes."
