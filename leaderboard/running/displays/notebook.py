"""Bars in a notebook: drawn anew in place, as a cell shows no terminal."""

from __future__ import annotations

import io
import sys
import time
from typing import Any

from rich.console import Console, RenderableType
from rich.live import Live
from rich.progress import Progress, ProgressColumn, TaskID

from leaderboard.running.terminal import Terminal

_WIDTH = 110  # characters
_EVERY_S = 0.2  # bars are not drawn more often
_PRE = '<pre style="line-height:1.2;margin:0">{code}</pre>'


def in_notebook() -> bool:
    """Whether a cell shows what this process prints."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return type(shell).__name__ == "ZMQInteractiveShell"


def as_html(shown: RenderableType) -> str:
    """What rich prints, as HTML."""
    console = Terminal(record=True, file=io.StringIO(), width=_WIDTH, force_jupyter=False)
    console.print(shown)
    return console.export_html(inline_styles=True, code_format=_PRE)


class CellProgress(Progress):
    """Rich's bars, shown below a cell whenever one of them has moved."""

    def __init__(self, *columns: str | ProgressColumn, console: Console, **options: Any) -> None:
        super().__init__(*columns, console=console, auto_refresh=False, **options)
        self.live = _CellLive(self)

    def add_task(self, *given: Any, **options: Any) -> TaskID:
        task = super().add_task(*given, **options)
        self.refresh()
        return task

    def update(self, *given: Any, **options: Any) -> None:
        super().update(*given, **options)
        self.refresh()

    def advance(self, *given: Any, **options: Any) -> None:
        super().advance(*given, **options)
        self.refresh()

    def reset(self, *given: Any, **options: Any) -> None:
        super().reset(*given, **options)
        self.refresh()


class _CellLive(Live):
    """Where the bars are shown: one output of the cell, which is replaced."""

    def __init__(self, bars: CellProgress) -> None:
        super().__init__(
            console=bars.live.console,
            auto_refresh=False,
            transient=bars.live.transient,
            get_renderable=bars.get_renderable,
        )
        self._cell: Any = None
        self._drawn_s = 0.0

    def start(self, refresh: bool = False) -> None:
        self._started = True
        self._draw()

    def stop(self) -> None:
        if self._started:
            self._draw(empty=self.transient)
            self._started, self._cell = False, None

    def refresh(self) -> None:
        if self._started and time.monotonic() - self._drawn_s >= _EVERY_S:
            self._draw()

    def _draw(self, *, empty: bool = False) -> None:
        from IPython.display import HTML, display

        page = HTML("" if empty else as_html(self.get_renderable()))
        if self._cell is None:
            self._cell = display(page, display_id=True)
        else:
            self._cell.update(page)
        self._drawn_s = time.monotonic()
