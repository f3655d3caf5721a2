"""A table in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from di_envs.files.shown_text import in_markdown


def markdown_table(
    head: Sequence[str], rows: Sequence[Sequence[str]], rule: Sequence[str] = ()
) -> list[str]:
    """The lines of a table; a cell's line breaks become commas.

    Args:
        head: A heading for each column.
        rows: Cells.
        rule: What stands between the two, such as `--:` for numbers; a plain rule if empty.
    """
    return [_line(line) for line in (head, rule or ["---"] * len(head), *rows)]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(map(in_markdown, cells)) + " |"
