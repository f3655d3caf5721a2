"""What a person sees of a run under way: a bar with the time left, who drives what, what failed."""

from __future__ import annotations

from rich.console import Console

from leaderboard.records.record import RouteRecord
from leaderboard.running.displays.compile_bar import CompileBar
from leaderboard.running.displays.work_bar import EACH, Display, work_bar
from leaderboard.running.jobs import Job
from leaderboard.running.messages import Compiling

_LOOK_BACK_S = 3600.0  # routes take minutes
_SHOWN = 3  # jobs under way that fit on a line


class RunDisplay(Display):
    """Shows a run's progress on a console, within a `with`."""

    def __init__(self, console: Console) -> None:
        super().__init__(work_bar(EACH, console=console, look_back_s=_LOOK_BACK_S))
        self._under_way: dict[int, Job] = {}
        self._compiling = CompileBar(self._bars)
        self._driving = self._bars.add_task("", what="driving", visible=False)

    def say(self, line: str, style: str = "") -> None:
        """Prints a line above the bars."""
        self._bars.print(line, style=style or None, soft_wrap=True, highlight=False, markup=False)

    def plan(self, total: int, done: int) -> None:
        """So many jobs there are, and so many are done already."""
        self._bars.update(self._driving, total=total, completed=done, visible=True)
        if done:
            self.say(f"{done} of {total} routes were driven before and are kept")

    def compiling(self, event: Compiling) -> None:
        """A kernel is being compiled; one without a name: the last one was."""
        self._compiling.show(event)

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
        self._bars.advance(self._driving)
        self._describe()

    def again(self, job: Job, status: str, reason: str) -> None:
        """A job was lost, and is tried once more."""
        self._under_way.pop(job.index, None)
        self.say(f"{_name(job)}: {status}, tried again: {reason}", "yellow")
        self._describe()

    def _describe(self) -> None:
        names = [_name(job) for job in self._under_way.values()]
        more = [f"{len(names) - _SHOWN} more"] if len(names) > _SHOWN else []
        self._bars.update(self._driving, description=" · ".join(names[:_SHOWN] + more))


def _name(job: Job | RouteRecord) -> str:
    return f"route {job.route_id}, seed {job.seed}"
