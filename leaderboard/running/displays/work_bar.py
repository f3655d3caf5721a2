"""The bar that long work shows: how much is done, how long it took and takes yet. All look alike.

Whoever has something to show says what: a line for one kind of work, or several lines whose tasks
name theirs. Displays of a run, a study and a training are made of it.
"""

from __future__ import annotations

from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from typing_extensions import Self

from leaderboard.running.displays.notebook import CellProgress, in_notebook
from leaderboard.running.terminal import Terminal

LOOK_BACK_S = 300.0  # work goes in bursts: a rate over half a minute, rich's own, jumps about
EACH = "{task.fields[what]:<9}"  # for `what`: each task says it, as `add_task("", what="driving")`


def work_bar(
    what: str,
    unit: str = "",
    *,
    console: Console | None = None,
    transient: bool = False,
    look_back_s: float = LOOK_BACK_S,
) -> Progress:
    """A bar; a task's description says what is under way.

    Args:
        what: Is being done; `EACH` where there are several lines.
        unit: Of what is counted; `%` shows the share that is done in place of two numbers.
        console: Where it is shown; None for stderr.
        transient: Whether it goes once the work is done: what comes of it is printed then.
        look_back_s: The remaining time goes by the rate over so long.
    """
    numbers = [MofNCompleteColumn(), TextColumn(unit, markup=False)]
    kind = CellProgress if in_notebook() else Progress
    return kind(
        TextColumn(f"  {what}", markup=False),
        BarColumn(bar_width=30),
        *([TaskProgressColumn()] if unit == "%" else numbers),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}", markup=False),
        console=console or Terminal(stderr=True),
        speed_estimate_period=look_back_s,
        transient=transient,
    )


class Display:
    """Shows bars within a `with`."""

    def __init__(self, bars: Progress) -> None:
        self._bars = bars

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bars.stop()
