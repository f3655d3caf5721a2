"""What a person sees of a recipe being run: a bar over its stages, one of the stage under way."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from agents.training.recipes.kinds import Progress
from agents.training.recipes.marker import Marker
from agents.training.recipes.recipe import Stage
from leaderboard.running.compiling import compile_events
from leaderboard.running.displays.compile_bar import CompileBar
from leaderboard.running.displays.work_bar import EACH, Display, work_bar


class RecipeDisplay(Display):
    """Shows a recipe on stderr, within a `with`; a `Watcher`.

    Args:
        stages: How many there are to be.
        stop: Whether somebody has asked to stop.
        say: Told a line when a stage is done.
    """

    def __init__(
        self, stages: int, *, stop: Callable[[], bool], say: Callable[[str], None]
    ) -> None:
        super().__init__(work_bar(EACH))
        self.stop, self._say = stop, say
        self._all = self._bars.add_task("", what="stages", total=stages)
        self._one = self._bars.add_task("", what="", total=None, visible=False)
        self._compiled = CompileBar(self._bars)

    def begins(self, stage: Stage, number: int, of: int) -> None:
        """A stage begins, or goes on."""
        self._bars.update(self._all, completed=number - 1, description=stage.name)
        self._bars.reset(self._one, visible=True, total=None, description="")
        self._bars.update(self._one, what=stage.kind)

    def tells(self, progress: Progress) -> None:
        """How far it has come."""
        self._bars.update(
            self._one,
            completed=min(progress.done, progress.total),
            total=progress.total,
            description=f"{progress.unit}  {progress.about}",
        )

    def ends(self, stage: Stage, marker: Marker, number: int, of: int) -> None:
        """It is done."""
        self._bars.update(self._all, completed=number)
        self._bars.update(self._one, visible=False)
        self._say(f"Stage {number} of {of}, {stage.name}: {marker.said} ({clock(marker.spent_s)}).")

    @contextmanager
    def compiling(self) -> Iterator[None]:
        """Shows kernels that are compiled within."""
        with compile_events(self._compiled.show):
            yield
        self._compiled.fill()


def clock(seconds: float) -> str:
    """Minutes and seconds, or hours and minutes: `1:40`, `2 h 05`."""
    whole = round(seconds)
    if whole < 3600:
        return f"{whole // 60}:{whole % 60:02d}"
    return f"{whole // 3600} h {whole % 3600 // 60:02d}"
