"""An ablation's findings for its record, and where it differs from the paper in words."""

from __future__ import annotations

from typing import Any

from leaderboard.studies.ablation import Ablation, RowFinding
from leaderboard.studies.effects import (
    EQUIVALENT,
    Effect,
)
from leaderboard.studies.numbers import effect_numbers


def findings(ablation: Ablation) -> dict[str, Any]:
    """What was worked out, as JSON values."""
    rows = {}
    for row in ablation.rows:
        found = effect_numbers(row.difference)
        rows[row.driven.row.name] = {
            "driving_score": row.driving_score,
            "route_completion": row.route_completion,
            "infraction_score": row.infraction_score,
            "difference": found.pop("mean"),
            **found,
            "verdict": row.verdict,
            "clear": row.difference.clear,
            "completion_difference": row.completion_difference,
            "penalty_difference": row.penalty_difference,
            "per_km": row.per_km,
            "same": row.same,
            "wall_s": row.driven.wall_s,
            "paper_difference": row.paper_difference,
        }
    correlations = {
        each.group: {"rho": each.rho, "interval": [each.low, each.high], "rows": each.rows}
        for each in ablation.correlations
    }
    return {"tests": ablation.tests, "rows": rows, "spearman_with_paper": correlations}


def sentences(ablation: Ablation) -> list[str]:
    """One sentence for each row on which the paper and this study differ."""
    found = []
    for row in ablation.rows:
        if row.judged_otherwise_in_paper or row.outside:
            here = f"{row.difference.mean:+.1f} DS, {_span(row.difference)}"
            there = f"{row.paper_difference:+.1f} there"
            found.append(f"{row.driven.row.edit} {_differs(row)} ({here}; {there}).")
    return found


def _differs(row: RowFinding) -> str:
    """What a row does here, and what in the paper."""
    if row.judged_otherwise_in_paper:
        if row.verdict == EQUIVALENT:
            return "makes no difference here, but does in the paper"
        return "matters here, but hardly in the paper"
    if row.difference.mean < (row.paper_difference or 0.0):
        return "costs more here than in the paper"
    return "costs less here than in the paper"


def _span(found: Effect) -> str:
    return "no interval" if found.low is None else f"{found.low:+.1f} … {found.high:+.1f}"
