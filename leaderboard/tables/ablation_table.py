"""An ablation as tables, for the terminal and in Markdown, with the paper beside and in words."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group
from rich.table import Table
from rich.text import Text

from di_envs.files.shown_text import in_markdown, in_one_line
from leaderboard.studies.ablation import Ablation
from leaderboard.studies.ablation_findings import sentences
from leaderboard.studies.effects import MATTERS
from leaderboard.studies.rows import NULL
from leaderboard.studies.table_two import TABLE_2
from leaderboard.tables.ablation_cells import (
    DETAIL_COLUMNS,
    Cells,
    detail_cells,
    effect_cells,
    effect_columns,
    has_paper,
    kind_name,
    title,
)
from leaderboard.tables.ablation_notes import notes
from leaderboard.tables.markdown_table import markdown_table

_LEFT = ("row", "verdict", "infractions per km")


def ablation_tables(ablation: Ablation) -> Group:
    """For the terminal."""
    plain = 1 + bool(ablation.study.row(NULL).drives)
    effects = _table(title(ablation), effect_columns(ablation), effect_cells(ablation), plain)
    details = _table("what else changes", DETAIL_COLUMNS, detail_cells(ablation), plain)
    said = [Text(line) for line in sentences(ablation)]
    return Group(effects, details, *said, Text("\n".join(notes(ablation)), style="dim"))


def _table(name: str, head: Sequence[str], rows: Cells, plain: int) -> Table:
    """The first rows, which are compared with nothing, stand by themselves."""
    table = Table(title=in_one_line(name), title_justify="left", title_style="bold")
    for column in head:
        left = column in _LEFT
        whole = column == "interval"
        table.add_column(
            column, justify="left" if left else "right", overflow="fold", no_wrap=whole
        )
    for number, cells in enumerate(rows, start=1):
        table.add_row(*cells, style="bold" if MATTERS in cells else None)
        if number == plain:
            table.add_section()
    return table


def ablation_markdown(ablation: Ablation, picture: str = "") -> str:
    """For a file: the table, all infractions by row, verdicts beside the paper's, notes.

    Args:
        ablation: The study worked out.
        picture: File name of its figure, beside it; none if empty.
    """
    lines = [f"# {in_markdown(title(ablation))}", ""]
    if picture:
        lines += [f"![Differences of driving score with their intervals]({picture})", ""]
    return "\n".join([*lines, *table_lines(ablation)])


def table_lines(ablation: Ablation) -> list[str]:
    """The tables of a study's rows and its notes, in Markdown."""
    lines = ["## Driving score", ""]
    lines += markdown_table(effect_columns(ablation), effect_cells(ablation))
    lines += ["", "## What else changes", ""]
    lines += markdown_table(DETAIL_COLUMNS, detail_cells(ablation))
    if has_paper(ablation):
        lines += ["", "## Beside the paper", "", *_beside_paper(ablation)]
    lines += ["", "## Infractions per km, less the baseline's", ""]
    kinds = sorted({name for row in ablation.rows for name in row.per_km})
    cells = [
        (row.driven.row.edit, *(f"{row.per_km.get(kind, 0.0):+.2f}" for kind in kinds))
        for row in ablation.rows
    ]
    lines += markdown_table(("row", *map(kind_name, kinds)), cells)
    return [*lines, "", "## Notes", "", *(f"- {in_markdown(line)}" for line in notes(ablation)), ""]


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
    return [*table, "", *(f"- {in_markdown(line)}" for line in sentences(ablation))]
