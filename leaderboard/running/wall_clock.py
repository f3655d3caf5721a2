"""Wall-clock limits: what a worker is doing, since when, and whether that takes too long.

A worker notes each change in two numbers of memory that its parent sees too. Only the parent judges
and kills, so a worker that hangs, even inside a library that holds Python's lock, is found out.
"""

from __future__ import annotations

import signal
import time
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any

CELLS = 4  # numbers that a stopwatch is made of
# Asks a process to write down where in its code it is; 0 on systems without such signals
WHERE_SIGNAL = int(getattr(signal, "SIGUSR1", 0))


class Doing(IntEnum):
    """What a worker is at."""

    WAITING = 0
    LOADING = 1
    SETTING_UP = 2
    STEPPING = 3
    SIMULATING = 4
    CLOSING = 5


_NAMES = {
    Doing.LOADING: "loading the town and the kernels",
    Doing.SETTING_UP: "setting up the agent",
    Doing.STEPPING: "a step of the agent",
    Doing.SIMULATING: "a step of the simulation",
    Doing.CLOSING: "closing the agent",
}


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Wall-clock seconds after which a worker is killed.

    Attributes:
        step_s: For one decision of the agent; 60 s as the time limit of CARLA's client.
        setup_s: For anything else that is one piece: making an agent, loading a town.
        route_s: For a whole route with its set-up.
    """

    step_s: float = 60.0
    setup_s: float = 300.0
    route_s: float = 7200.0

    def __post_init__(self) -> None:
        for limit in fields(self):
            if not getattr(self, limit.name) > 0.0:
                raise ValueError(f"{limit.name} must be positive, got {getattr(self, limit.name)}")


class Stopwatch:
    """What a worker is doing: written by the worker, read by its parent.

    Args:
        cells: (4,) shared doubles: what is being done, since when, and since when the job runs
            (0 for no job), in seconds of a clock that all processes of a machine share; and in
            which process the agent is (0 for the worker's own). None when nobody else looks.
        place: Descriptor of the file into which who hangs writes where; None for none.
    """

    def __init__(self, cells: Any = None, place: int | None = None) -> None:
        self._cells = [0.0] * CELLS if cells is None else cells
        self.place = place

    def mark(self, doing: Doing) -> None:
        """From now on this is done."""
        self._cells[1] = time.monotonic()
        self._cells[0] = doing

    def lap(self) -> None:
        """What is being done goes on well: its time is counted from now."""
        self._cells[1] = time.monotonic()

    def begin_job(self) -> None:
        """A job begins."""
        self._cells[2] = time.monotonic()

    def end_job(self) -> None:
        """The job is over, and the worker waits for another."""
        self.mark(Doing.WAITING)
        self._cells[2] = 0.0

    @property
    def agent_process(self) -> int:
        """Id of the process that the agent drives in; 0 where it is the worker's own."""
        return int(self._cells[3])

    @agent_process.setter
    def agent_process(self, process_id: int) -> None:
        self._cells[3] = process_id

    @property
    def doing(self) -> Doing:
        """What is being done."""
        return Doing(int(self._cells[0]))

    def overdue(self, limits: Limits) -> str:
        """What takes too long, and how long it may take; empty while all is well."""
        doing, now_s = self.doing, time.monotonic()
        limit_s = limits.step_s if doing == Doing.STEPPING else limits.setup_s
        if doing != Doing.WAITING and now_s - self._cells[1] > limit_s:
            return f"{_NAMES[doing]} took more than {limit_s:g} s"
        if self._cells[2] and now_s - self._cells[2] > limits.route_s:
            return f"the route took more than {limits.route_s:g} s of wall-clock time"
        return ""
