"""An ablation as tables, for the terminal and in Markdown, with the paper beside and in words."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from di_envs.world.event_names import event_of_key
from leaderboard.scoring.names import EVENT_NAMES
from leaderboard.studies.ablation import Ablation, RowFinding
from leaderboard.studies.ablation_findings import sentences
from leaderboard.studies.effects import ALPHA, EQUIVALENT, MARGIN_DS, MATTERS, POWER
from leaderboard.studies.record import DrivenRow, Study
from leaderboard.studies.rows import BASELINE, NULL
from leaderboard.studies.table_two import BASELINE as PAPER_BASELINE
from leaderboard.studies.table_two import TABLE_2
from leaderboard.tables.comparison_table import FEW_ROUTES

# Heading, and whether its cells stand at the left
_EFFECTS = ("row", "DS", "change", "interval", "verdict", "could see")
_PAPER = "paper"
_DETAILS = ("row", "RC", "IS", "infractions per km", "same drives", "driven in")
_LEFT = ("row", "verdict", "infractions per km")
_SHOWN_KINDS = 3  # infractions that fit beside a row
_LOW_DS = 4.0 * MARGIN_DS  # a baseline below that cannot fall by much
Cells = list[tuple[str, ...]]


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
    return (*_EFFECTS, _PAPER) if _has_paper(ablation) else _EFFECTS


def _has_paper(ablation: Ablation) -> bool:
    return any(row.paper_difference is not None for row in ablation.rows)


def detail_cells(ablation: Ablation) -> Cells:
    """What else changes with each row, in the order of `_DETAILS`."""
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
    return ", ".join(f"{rate:+.2f} {_kind(name)}" for name, rate in largest)


def _kind(name: str) -> str:
    return EVENT_NAMES[event_of_key(name)]


def time_text(seconds: float) -> str:
    """`12 s`, `3.4 min` or `1.2 h`."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.1f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"


def title(ablation: Ablation) -> str:
    """What was studied."""
    study = ablation.study
    seeds = len(study.seeds)
    shared = f" with {'; '.join(study.interventions)}" if study.interventions else ""
    return (
        f"{study.kind.capitalize()} of {study.agent}{shared} on {study.suite}, {seeds} "
        f"seed{'s' if seeds > 1 else ''}, rules {study.rules}"
    )


def notes(ablation: Ablation) -> list[str]:
    """How to read the table, and what limits it."""
    study, tests = ablation.study, ablation.tests
    lines = [
        "Differences are to the baseline in the same worlds (route and seed). Intervals: bootstrap "
        f"over {ablation.routes} distinct routes, each with its seeds; all {tests} hold together "
        f"with {100 * (1 - ALPHA):.0f} % (Bonferroni).",
        f"matters: the interval excludes 0. equivalent: two one-sided tests say within "
        f"±{MARGIN_DS:g} DS. could see: the effect that would have been found with "
        f"{100 * POWER:.0f} % probability ('-': nothing varied).",
    ]
    if _has_paper(ablation):
        lines.append(
            "paper: difference of DS in Table 2 of Li et al., 2024; its model had Town05 in "
            "training, the shipped policy had not; its rows have no interval."
        )
    baseline = mean_of(study.baseline, "driving_score")
    if baseline is not None and baseline < _LOW_DS:
        lines.append(
            f"The baseline's DS is {baseline:.1f}: no row can fall by more, so 'equivalent' says "
            "little of what such an agent uses."
        )
    for each in ablation.correlations:
        if each.rho is not None:
            span = "" if each.low is None else f" ({each.low:+.2f} … {each.high or 0.0:+.2f})"
            lines.append(
                f"Spearman's rank correlation with the paper, {each.group} rows: "
                f"{each.rho:+.2f}{span} over {each.rows} components."
            )
    if any(row.changed_routes == 0 for row in ablation.rows):
        share = min(3.0 / max(ablation.routes, 1), 1.0)
        lines.append(
            "Where all drives are the same, the interval is 0 … 0 for these routes; of all routes "
            f"like them up to {100 * share:.0f} % may still change (rule of three)."
        )
    if 1 < ablation.routes < FEW_ROUTES:
        lines.append(f"With {ablation.routes} routes the intervals are likely too narrow.")
    if ablation.routes == 1:
        lines.append("One route: there are no intervals, and nothing can be said of others.")
    lines += _missing(study)
    total_s = sum(driven.wall_s for driven in study.rows)
    lines.append(f"Driven in {time_text(total_s)} of wall-clock time, added up over processes.")
    return lines


def _missing(study: Study) -> list[str]:
    """Rows left out, not finished, or without some drives."""
    lines = [f"Left out: {driven.row.name}: {driven.left_out}." for driven in study.left_out]
    for driven in study.rows:
        if not driven.left_out and not driven.complete and driven.row.name != BASELINE:
            lines.append(
                f"Not complete: {driven.row.name}: {len(driven.drives)} of {driven.planned} drives."
            )
    return lines


def ablation_tables(ablation: Ablation) -> Group:
    """For the terminal."""
    plain = 1 + bool(ablation.study.row(NULL).drives)
    effects = _table(title(ablation), effect_columns(ablation), effect_cells(ablation), plain)
    details = _table("what else changes", _DETAILS, detail_cells(ablation), plain)
    said = [Text(line) for line in sentences(ablation)]
    return Group(effects, details, *said, Text("\n".join(notes(ablation)), style="dim"))


def _table(name: str, head: Sequence[str], rows: Cells, plain: int) -> Table:
    """The first rows, which are compared with nothing, stand by themselves."""
    table = Table(title=escape(name), title_justify="left", title_style="bold")
    for column in head:
        left = column in _LEFT
        whole = column == "interval"
        table.add_column(
            column, justify="left" if left else "right", overflow="fold", no_wrap=whole
        )
    for number, cells in enumerate(rows, start=1):
        table.add_row(*map(escape, cells), style="bold" if MATTERS in cells else None)
        if number == plain:
            table.add_section()
    return table


def ablation_markdown(ablation: Ablation, picture: str = "") -> str:
    """For a file: the table, all infractions by row, verdicts beside the paper's, notes.

    Args:
        ablation: The study worked out.
        picture: File name of its figure, beside it; none if empty.
    """
    lines = [f"# {title(ablation)}", ""]
    if picture:
        lines += [f"![Differences of driving score with their intervals]({picture})", ""]
    return "\n".join([*lines, *table_lines(ablation)])


def table_lines(ablation: Ablation) -> list[str]:
    """The tables of a study's rows and its notes, in Markdown."""
    lines = ["## Driving score", ""]
    lines += markdown_table(effect_columns(ablation), effect_cells(ablation))
    lines += ["", "## What else changes", ""]
    lines += markdown_table(_DETAILS, detail_cells(ablation))
    if _has_paper(ablation):
        lines += ["", "## Beside the paper", "", *_beside_paper(ablation)]
    lines += ["", "## Infractions per km, less the baseline's", ""]
    kinds = sorted({name for row in ablation.rows for name in row.per_km})
    cells = [
        (row.driven.row.edit, *(f"{row.per_km.get(kind, 0.0):+.2f}" for kind in kinds))
        for row in ablation.rows
    ]
    lines += markdown_table(("row", *map(_kind, kinds)), cells)
    return [*lines, "", "## Notes", "", *(f"- {line}" for line in notes(ablation)), ""]


def _beside_paper(ablation: Ablation) -> list[str]:
    cells = [
        (
            row.driven.row.edit,
            f"{row.difference.mean + 0.0:+.1f}",
            row.verdict,
            f"{TABLE_2[row.driven.row.component].difference:+.1f}",
            TABLE_2[row.driven.row.component].verdict,
        )
        for row in ablation.rows
        if row.driven.row.component in TABLE_2
    ]
    table = markdown_table(("row", "here", "verdict", "there", "verdict there"), cells)
    return [*table, "", *(f"- {line}" for line in sentences(ablation))]


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return ["| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines]
