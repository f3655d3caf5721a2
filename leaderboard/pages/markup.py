"""HTML elements as text: every value is escaped on its way in, so no name can break a page.

Nor can one turn a line around: characters that nobody sees are spelled out.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from typing import Any

from di_envs.files.plain_text import plain


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


Content = str | Markup


def element(name: str, *content: Content, **attributes: object) -> Markup:
    """`<name attributes>content</name>`.

    Args:
        name: Of the element.
        content: What is in it; plain text is escaped.
        attributes: By name, `_` for `-` within and after words of Python; None leaves one out.
    """
    pairs = (
        f' {key.rstrip("_").replace("_", "-")}="{escape(plain(str(value)))}"'
        for key, value in attributes.items()
        if value is not None
    )
    return Markup(f"<{name}{''.join(pairs)}>{joined(content)}</{name}>")


def joined(parts: Iterable[Content]) -> Markup:
    """Parts one after the other; plain text is escaped."""
    return Markup(
        "".join(part if isinstance(part, Markup) else escape(plain(part)) for part in parts)
    )


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A cell of a table: what it shows, and what it is sorted by where that is not the text."""

    shows: Content
    sort: float | str | None = None
    note: str | None = None  # a tooltip


@dataclass(frozen=True, kw_only=True)
class Heading:
    """A column's heading: `number` columns stand right and are sorted by value."""

    name: str
    number: bool = False
    note: str | None = None


@dataclass(frozen=True, kw_only=True)
class TableOf:
    """A table that can be sorted: its id, headings, rows, and a last row that stays last.

    `ascending` names the heading by which the rows stand in order already.
    """

    id: str
    headings: Sequence[Heading]
    rows: Sequence[Sequence[Cell]]
    last: Sequence[Cell] = field(default=())
    ascending: str = ""

    def markup(self) -> Markup:
        """The table as HTML; `data-sort` tells the page's script how each column is sorted."""
        head = element("tr", *(self._heading(heading) for heading in self.headings))
        body = joined(self._row(row) for row in self.rows)
        parts = [element("thead", head), element("tbody", body)]
        if self.last:
            parts.append(element("tfoot", self._row(self.last)))
        return element("table", *parts, id=self.id, class_="sortable")

    def _heading(self, heading: Heading) -> Markup:
        return element(
            "th",
            heading.name,
            scope="col",
            class_="number" if heading.number else None,
            data_sort="number" if heading.number else "text",
            aria_sort="ascending" if heading.name == self.ascending else None,
            title=heading.note,
        )

    def _row(self, row: Sequence[Cell]) -> Markup:
        pairs = zip(self.headings, row, strict=True)
        return element("tr", *(_cell(heading, cell) for heading, cell in pairs))


def _cell(heading: Heading, cell: Cell) -> Markup:
    return element(
        "td",
        cell.shows,
        class_="number" if heading.number else None,
        data_value=cell.sort,
        title=cell.note,
    )


def json_script(identity: str, value: Any) -> Markup:
    """JSON that a script of the page reads by its id; nothing in it can end the element."""
    text = json.dumps(_plain(value), separators=(",", ":"), allow_nan=False)
    text = text.replace("<", "\\u003c")
    return Markup(f'<script type="application/json" id="{identity}">{text}</script>')


def _plain(value: Any) -> Any:
    """JSON values with plain texts."""
    if isinstance(value, str):
        return plain(value)
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def static_text(name: str) -> str:
    """One of the files that pages are made from: a template, a style, a script."""
    return (files("leaderboard.pages") / "static" / name).read_text(encoding="utf-8")
