"""What a person sees of a study under way: a bar over all its rows, and one of the row's own."""

from __future__ import annotations

from types import TracebackType

from rich.console import Console
from rich.progress import TaskID
from typing_extensions import Self

from leaderboard.records.record import RouteRecord
from leaderboard.running.displays.run import RunDisplay


class StudyDisplay(RunDisplay):
    """Shows many runs one after the other; each may open and close it, it stays open between."""

    def __init__(self, console: Console) -> None:
        super().__init__(console)
        self._open = 0
        self._study: TaskID = self._bars.add_task("", what="the study", visible=False)

    def __enter__(self) -> Self:
        self._open += 1
        return super().__enter__() if self._open == 1 else self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._open -= 1
        if self._open == 0:
            super().__exit__(kind, error, trace)

    def plan_study(self, total: int, done: int) -> None:
        """So many drives there are in all rows together, and so many are done."""
        self._bars.update(self._study, total=total, completed=done, visible=total > done)

    def row(self, name: str) -> None:
        """This row is driven now."""
        self._bars.reset(self._driving, visible=False)
        self._bars.update(self._study, description=name)

    def plan(self, total: int, done: int) -> None:
        """Of the row under way; what was driven before is counted in the study's bar."""
        self._bars.update(self._driving, total=total, completed=done, visible=True)

    def finished(self, record: RouteRecord) -> None:
        super().finished(record)
        self._bars.advance(self._study)
