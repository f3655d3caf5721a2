"""What a person sees of a run under way: a bar with the time left, who drives what, what failed."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from leaderboard.records.record import RouteRecord
from leaderboard.running.jobs import Job
from leaderboard.running.messages import Compiling

_ETA_PERIOD_S = 3600.0  # routes take minutes: rich looks back half a minute only, by itself
_SHOWN = 3  # jobs under way that fit on a line


class RunDisplay:
    """Shows a run's progress on a console, within a `with`."""

    def __init__(self, console: Console) -> None:
        self._under_way: dict[int, Job] = {}
        self._progress = Progress(
            TextColumn("  {task.fields[what]}"),
            BarColumn(bar_width=30),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.description}"),
            console=console,
            speed_estimate_period=_ETA_PERIOD_S,
        )
        self._compiling = self._progress.add_task("", what="compiling", visible=False)
        self._driving = self._progress.add_task("", what="driving  ", visible=False)

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._progress.stop()

    def say(self, line: str, style: str = "") -> None:
        """Prints a line above the bars."""
        self._progress.print(escape(line), style=style or None, soft_wrap=True, highlight=False)

    def plan(self, total: int, done: int) -> None:
        """So many jobs there are, and so many are done already."""
        self._progress.update(self._driving, total=total, completed=done, visible=True)
        if done:
            self.say(f"{done} of {total} routes were driven before and are kept")

    def compiling(self, event: Compiling) -> None:
        """A kernel is being compiled; one without a name: the last one was."""
        task = self._progress.tasks[self._compiling]
        if event.kernel and not task.visible:
            from leaderboard.running.compiling import COMPILING

            self.say(COMPILING)
        if event.kernel:
            self._progress.update(
                self._compiling,
                visible=True,
                total=event.total,
                completed=event.done,
                description=event.kernel,
            )
        elif task.visible:  # full: kernels that this run does not need are not compiled
            self._progress.update(self._compiling, completed=task.total, description="done")

    def started(self, job: Job) -> None:
        """A worker drives this now."""
        self._under_way[job.index] = job
        self._describe()

    def finished(self, record: RouteRecord) -> None:
        """A job is done, well or not, and is not tried again."""
        self._under_way.pop(record.index, None)
        if record.crashed:
            style = "magenta" if record.lost else "red"
            kept = ": left out of the means" if record.lost else ""
            self.say(f"{_name(record)}: {record.status}{kept}: {record.reason}", style)
        self._progress.advance(self._driving)
        self._describe()

    def again(self, job: Job, status: str, reason: str) -> None:
        """A job was lost, and is tried once more."""
        self._under_way.pop(job.index, None)
        self.say(f"{_name(job)}: {status}, tried again: {reason}", "yellow")
        self._describe()

    def _describe(self) -> None:
        names = [_name(job) for job in self._under_way.values()]
        more = [f"{len(names) - _SHOWN} more"] if len(names) > _SHOWN else []
        self._progress.update(self._driving, description=escape(" · ".join(names[:_SHOWN] + more)))


def _name(job: Job | RouteRecord) -> str:
    return f"route {job.route_id}, seed {job.seed}"
