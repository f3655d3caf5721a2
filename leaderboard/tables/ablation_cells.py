"""What stands in the tables of an ablation, cell by cell, whatever draws them."""

from __future__ import annotations

from di_envs.world.event_names import event_of_key
from leaderboard.scoring.names import EVENT_NAMES
from leaderboard.studies.ablation import Ablation, RowFinding
from leaderboard.studies.effects import EQUIVALENT
from leaderboard.studies.record import DrivenRow
from leaderboard.studies.rows import BASELINE, NULL
from leaderboard.studies.table_two import BASELINE as PAPER_BASELINE

_EFFECTS = ("row", "DS", "change", "interval", "verdict", "could see")
_PAPER = "paper"
DETAIL_COLUMNS = ("row", "RC", "IS", "infractions per km", "same drives", "driven in")
_SHOWN_KINDS = 3  # infractions that fit beside a row
Cells = list[tuple[str, ...]]


def title(ablation: Ablation) -> str:
    """What was studied."""
    study = ablation.study
    seeds = len(study.seeds)
    shared = f" with {'; '.join(study.interventions)}" if study.interventions else ""
    return (
        f"{study.kind.capitalize()} of {study.agent}{shared} on {study.suite}, {seeds} "
        f"seed{'s' if seeds > 1 else ''}, rules {study.rules}"
    )


def effect_cells(ablation: Ablation) -> Cells:
    """What each row does to the driving score, in the order of `effect_columns`."""
    study, null = ablation.study, ablation.study.row(NULL)
    paper = f"{PAPER_BASELINE.driving_score:.1f} DS"
    cells: Cells = [(BASELINE, _mean_text(study.baseline, "driving_score", 1), *[""] * 4, paper)]
    if null.drives:
        zero = "exactly 0"
        cells.append((null.row.edit, _mean_text(null, "driving_score", 1), "0", zero, *[""] * 3))
    for row in ablation.rows:
        found, there = row.difference, row.paper_difference
        cells.append(
            (
                row.driven.row.edit,
                f"{row.driving_score:.1f}",
                f"{found.mean + 0.0:+.1f}",
                "-" if found.low is None else f"{found.low:+.1f} … {found.high or 0.0:+.1f}",
                _verdict_text(row),
                "-" if found.smallest is None else f"{found.smallest:.1f}",
                "-" if there is None else f"{there:+.1f}",
            )
        )
    return [row[: len(effect_columns(ablation))] for row in cells]


def effect_columns(ablation: Ablation) -> tuple[str, ...]:
    """The headings; the paper's only where it has a figure for a row."""
    return (*_EFFECTS, _PAPER) if has_paper(ablation) else _EFFECTS


def has_paper(ablation: Ablation) -> bool:
    """Whether the paper has a figure for any row."""
    return any(row.paper_difference is not None for row in ablation.rows)


def detail_cells(ablation: Ablation) -> Cells:
    """What else changes with each row, in the order of `DETAIL_COLUMNS`."""
    study = ablation.study
    cells: Cells = [
        (
            driven.row.edit or driven.row.name,
            _mean_text(driven, "route_completion", 1),
            _mean_text(driven, "infraction_score", 3),
            *("", ""),
            time_text(driven.wall_s),
        )
        for driven in (study.baseline, study.row(NULL))
        if driven.drives
    ]
    for row in ablation.rows:
        cells.append(
            (
                row.driven.row.edit,
                f"{row.route_completion:.1f} ({row.completion_difference + 0.0:+.1f})",
                f"{row.infraction_score:.3f} ({row.penalty_difference + 0.0:+.3f})",
                infraction_text(row),
                f"{row.same} of {row.difference.pairs}",
                time_text(row.driven.wall_s),
            )
        )
    return cells


def _mean_text(driven: DrivenRow, score: str, digits: int) -> str:
    mean = mean_of(driven, score)
    return "-" if mean is None else f"{mean:.{digits}f}"


def mean_of(driven: DrivenRow, score: str) -> float | None:
    """The mean of a field of a row's drives; None without any."""
    values = [getattr(drive, score) for drive in driven.drives]
    return sum(values) / len(values) if values else None


def _verdict_text(row: RowFinding) -> str:
    small_but_sure = row.verdict == EQUIVALENT and row.difference.clear
    so_far = "" if row.driven.complete else ", so far"
    return f"{row.verdict}{', not 0' if small_but_sure else ''}{so_far}"


def infraction_text(row: RowFinding) -> str:
    """The kinds whose number per km changed most: `+2.1 red light, -0.3 timeout`."""
    largest = sorted(row.per_km.items(), key=lambda item: -abs(item[1]))[:_SHOWN_KINDS]
    return ", ".join(f"{rate:+.2f} {kind_name(name)}" for name, rate in largest)


def kind_name(name: str) -> str:
    """The name of a kind of event by its key."""
    return EVENT_NAMES[event_of_key(name)]


def time_text(seconds: float) -> str:
    """`12 s`, `3.4 min` or `1.2 h`."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.1f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"
