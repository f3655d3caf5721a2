"""Markdown tables: no cell breaks one."""

from __future__ import annotations

from leaderboard.tables.markdown_table import markdown_table


def test_a_bar_or_a_line_break_in_a_cell_breaks_no_row():
    lines = markdown_table(("a", "b\nc"), [("x|y", "1")], rule=(":--", "--:"))
    assert lines == ["| a | b, c |", "| :-- | --: |", "| x\\|y | 1 |"]


def test_columns_stand_as_the_reader_has_them_unless_told():
    assert markdown_table(("a", "b"), []) == ["| a | b |", "| --- | --- |"]
