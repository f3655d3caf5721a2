"""Threads that share out work: whoever is free takes the next job."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from gymnasium.error import ClosedEnvironmentError


class Crew:
    """So many threads, the calling one among them; the others are made when they are needed.

    Attributes:
        threads: How many there are.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._closed = False
        self._pool: ThreadPoolExecutor | None = None
        self._pool_of = 0

    def each(self, jobs: Sequence[Callable[[], None]]) -> None:
        """Does all jobs, and returns once they are done.

        Raises:
            ClosedEnvironmentError: If the crew was closed.
            Exception: What a job raised.
        """
        todo = iter(jobs)  # next() on it holds the lock of the interpreter: nobody gets a job twice

        def labour() -> None:
            for job in todo:
                job()

        pool = self._helpers()
        helpers = [] if pool is None else [pool.submit(labour) for _ in range(self.threads - 1)]
        try:
            labour()
        finally:
            errors = [helper.exception() for helper in helpers]
        for error in filter(None, errors):
            raise error

    def close(self) -> None:
        """Lets the threads go."""
        self._closed = True
        if self._pool is not None and self._pool_of == os.getpid():
            self._pool.shutdown()

    def _helpers(self) -> ThreadPoolExecutor | None:
        """The threads beside the calling one; made anew in a process that was forked.

        A fork takes no threads along, and whoever waits for one there waits for ever.
        """
        if self._closed:
            raise ClosedEnvironmentError("The environment is closed: make another one.")
        if self.threads > 1 and (self._pool is None or self._pool_of != os.getpid()):
            self._pool = ThreadPoolExecutor(self.threads - 1, "worlds")
            self._pool_of = os.getpid()
        return self._pool


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
