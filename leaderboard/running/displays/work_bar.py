"""The bar that long work shows: how much is done, how fast, how long it takes yet."""

from __future__ import annotations

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

_LOOK_BACK_S = 300.0  # work goes in bursts: a rate over half a minute, rich's own, jumps about


def work_bar(
    what: str, unit: str, *, console: Console | None = None, transient: bool = False
) -> Progress:
    """A bar; a task's description says what is under way.

    Args:
        what: Is being done.
        unit: Of what is counted.
        console: Where it is shown; None for stderr.
        transient: Whether it goes once the work is done: what comes of it is printed then.
    """
    return Progress(
        TextColumn(f"  {what}"),
        BarColumn(bar_width=30),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
        console=console or Console(stderr=True),
        speed_estimate_period=_LOOK_BACK_S,
        transient=transient,
    )
