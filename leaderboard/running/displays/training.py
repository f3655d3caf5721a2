"""What a person sees of a training under way: a bar with loss, speed and the routes of checks."""

from __future__ import annotations

import time
from collections.abc import Mapping

from leaderboard.running.displays.work_bar import Display, work_bar

_MEMORY = 0.98  # of the running mean of the waypoint loss


class TrainingDisplay(Display):
    """Shows a training on stderr, within a `with`."""

    def __init__(self, *, done: int, steps: int, batch: int) -> None:
        super().__init__(work_bar("training", "steps"))
        self._task = self._bars.add_task("", total=steps, completed=done)
        self._batch, self._waypoints_m = batch, 0.0
        self._steps, self._busy_s, self._since_s = 0, 0.0, time.monotonic()

    def step(self, step: int, terms: Mapping[str, float]) -> None:
        """A step is done."""
        now_s = time.monotonic()
        self._busy_s += now_s - self._since_s
        self._since_s, self._steps = now_s, self._steps + 1
        memory = min(_MEMORY, 1.0 - 1.0 / self._steps)
        self._waypoints_m = memory * self._waypoints_m + (1.0 - memory) * terms["waypoints"]
        speed = self._steps * self._batch / self._busy_s if self._busy_s else 0.0
        text = f"waypoints {self._waypoints_m:.2f} m, {speed:.0f} samples/s"
        self._bars.update(self._task, completed=step, description=text)

    def route(self, number: int) -> None:
        """A check drives its next route."""
        self._bars.update(self._task, description=f"checking: drives route {number}")

    def checked(self, driving_score: float) -> None:
        """A check is done."""
        self._since_s = time.monotonic()  # it does not count as training
        step = self._bars.tasks[0].completed
        self._bars.print(f"step {step:.0f}: driving score {driving_score:.1f}", highlight=False)
