"""Threads that share out work: whoever is free takes the next job."""

from __future__ import annotations

import os
import threading
import weakref
from collections.abc import Callable, Iterator, Sequence

from gymnasium.error import ClosedEnvironmentError

Job = Callable[[], None]


class Crew:
    """So many threads, the calling one among them; the others are made when they are needed.

    Attributes:
        threads: How many there are.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._closed = False
        self._helpers: list[Helper] = []
        self._helpers_of = 0

    def each(self, jobs: Sequence[Job]) -> None:
        """Does all jobs, and returns once they are done.

        Raises:
            ClosedEnvironmentError: If the crew was closed.
            Exception: What a job raised.
        """
        if self._closed:
            raise ClosedEnvironmentError("The environment is closed: make another one.")
        todo = iter(jobs)  # next() on it holds the lock of the interpreter: nobody gets a job twice
        helpers, self._helpers = self._ready(), []  # whoever interrupts this leaves some at work
        for helper in helpers:
            helper.begin(todo)
        try:
            labour(todo)
        finally:
            errors = [helper.finish() for helper in helpers]
            self._helpers = helpers
        for error in filter(None, errors):
            raise error

    def close(self) -> None:
        """Lets the threads go."""
        self._closed = True
        self._helpers = []

    def _ready(self) -> list[Helper]:
        """The threads beside the calling one; made anew in a process that was forked.

        A fork takes no threads along, and whoever waits for one there waits for ever.
        """
        if len(self._helpers) < self.threads - 1 or self._helpers_of != os.getpid():
            self._helpers = [Helper() for _ in range(self.threads - 1)]
            self._helpers_of = os.getpid()
        return self._helpers


class Helper:
    """A thread that works when it is told to, and ends with this object.

    Two bare locks take less time than the queue and futures of an executor, which counts where
    a step of sixteen worlds takes half a millisecond.
    """

    def __init__(self) -> None:
        self._desk = desk = _Desk()
        threading.Thread(target=desk.work, name="worlds", daemon=True).start()
        weakref.finalize(self, desk.give, None)

    def begin(self, todo: Iterator[Job]) -> None:
        """Has the thread take jobs until there are none."""
        self._desk.give(todo)

    def finish(self) -> BaseException | None:
        """Waits until it has none left; returns what one has raised."""
        return self._desk.result()


class _Desk:
    """Where a thread and who gives it work meet."""

    def __init__(self) -> None:
        self._todo: Iterator[Job] | None = None
        self._error: BaseException | None = None
        self._given, self._done = threading.Lock(), threading.Lock()
        self._given.acquire()
        self._done.acquire()

    def give(self, todo: Iterator[Job] | None) -> None:
        """Has the thread take jobs, or end."""
        self._todo, self._error = todo, None
        if self._given.locked():  # else it has not taken up yet what it was given before
            self._given.release()

    def result(self) -> BaseException | None:
        """What a job has raised, once none is left."""
        self._done.acquire()
        return self._error

    def work(self) -> None:
        """What the thread does, until it is given nothing."""
        while True:
            self._given.acquire()
            if self._todo is None:
                return
            try:
                labour(self._todo)
            except BaseException as error:
                self._error = error
            self._done.release()


def labour(todo: Iterator[Job]) -> None:
    """Takes the next job and does it, until there are none."""
    for job in todo:
        job()


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
