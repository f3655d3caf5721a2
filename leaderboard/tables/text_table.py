"""A table of words and numbers before it is drawn: the same rows for a terminal and in Markdown."""

from __future__ import annotations

from dataclasses import dataclass

from rich.table import Table

from di_envs.files.shown_text import in_markdown, in_one_line
from leaderboard.tables.markdown_table import markdown_table


@dataclass(frozen=True, kw_only=True)
class TextTable:
    """A table before it is a picture.

    Attributes:
        title: Above it.
        columns: Heads.
        rows: Cells.
        notes: Below it, a line each.
        words: How many columns from the left hold words, not numbers.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    words: int = 1

    def rich(self) -> Table:
        """For a terminal."""
        table = Table(
            title=in_one_line(self.title),
            title_justify="left",
            title_style="bold",
            caption="\n".join(map(in_one_line, self.notes)),
            caption_justify="left",
        )
        for place, name in enumerate(self.columns):
            table.add_column(name, justify="left" if place < self.words else "right")
        for row in self.rows:
            table.add_row(*row)
        return table

    def markdown(self) -> str:
        """For a document."""
        rule = [":--" if place < self.words else "--:" for place in range(len(self.columns))]
        table = markdown_table(self.columns, self.rows, rule)
        lines = [f"### {in_markdown(self.title)}", "", *table, ""]
        lines += [f"{in_markdown(note)}  " for note in self.notes]
        return "\n".join(lines).rstrip() + "\n"
