"""The bar of kernels that are being compiled: there is none while all come from the cache."""

from __future__ import annotations

from rich.progress import Progress

from leaderboard.running.messages import Compiling

COMPILING = "Compiling kernels, once for this version and CPU (half a minute or so)"


class CompileBar:
    """A line among others, or the only one, that appears with the first kernel."""

    def __init__(self, bars: Progress) -> None:
        """Adds the line, hidden; `bars` has lines that name themselves, see `EACH`."""
        self._bars = bars
        self._task = bars.add_task("", what="compiling", visible=False)

    def show(self, event: Compiling) -> None:
        """A kernel is being compiled; one without a name: the last one was."""
        if not event.kernel:
            self.fill()
            return
        if not self._begun:
            self._bars.print(COMPILING, soft_wrap=True, highlight=False)
            self._bars.start()
        self._bars.update(
            self._task,
            visible=True,
            total=event.total,
            completed=event.done,
            description=event.kernel,
        )

    def fill(self) -> None:
        """No more kernels come: the bar is full, as those not needed are not compiled."""
        if self._begun:
            total = self._bars.tasks[self._task].total
            self._bars.update(self._task, completed=total, description="done")

    @property
    def _begun(self) -> bool:
        return self._bars.tasks[self._task].visible
