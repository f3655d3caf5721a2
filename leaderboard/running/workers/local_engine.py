"""Where jobs run: processes of this machine here, a cluster in `ray_engine`. Same bits anywhere.

An engine drives what it is given and tells what became of it; who drives what is for `scheduler`,
and what is tried again, kept or shown for `runner`, each once for all engines.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from typing import Protocol

from leaderboard.running.jobs import Job, RunSpec, SetupError
from leaderboard.running.messages import Compiling, Driven, EngineEvent, RunFacts, WorkerMessage
from leaderboard.running.wall_clock import Limits
from leaderboard.running.workers.scheduler import PAUSE_S, Scheduler
from leaderboard.running.workers.worker_process import WorkerProcess


class Engine(Protocol):
    """Drives jobs in processes that can be killed."""

    def run(self, spec: RunSpec, jobs: deque[Job]) -> Generator[EngineEvent]:
        """Drives all of `jobs`, taken from the left; ends when there are no more.

        Args:
            spec: What the jobs share.
            jobs: The caller may add to them while it handles an event; so it does at `Ready`,
                which comes first, and for a job to be tried again, at `Lost`.

        Yields:
            Events as they happen; `Pause` often enough that the caller can stop in time.

        Raises:
            SetupError: If the run cannot start.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class LocalEngine:
    """Jobs shared out among `workers` processes of this machine; each drives many."""

    workers: int = 1
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise ValueError(f"an engine needs at least 1 worker, not {self.workers}")

    def run(self, spec: RunSpec, jobs: deque[Job]) -> Generator[EngineEvent]:
        """See `Engine.run`."""
        yield from Scheduler(_Processes(spec, self.limits), self.workers, jobs).run()


class _Processes:
    """Worker processes of one run; see `Crew`.

    The first sets the run up and compiles as it begins to drive; the others load their modules
    meanwhile, and begin once the machine code is there to be loaded too.
    """

    def __init__(self, spec: RunSpec, limits: Limits) -> None:
        self._spec, self._limits = spec, limits
        self._compiled = False
        self._begun: set[WorkerProcess] = set()
        self._waiting: dict[WorkerProcess, RunFacts | None] = {}

    def hire(self, scene: RunFacts | None) -> WorkerProcess:
        """Starts a process.

        Raises:
            SetupError: If the system allows no more.
        """
        try:
            worker = WorkerProcess(self._spec, self._limits)
        except OSError as error:
            raise SetupError(
                f"cannot start a process to drive in ({error.strerror}): pass fewer --workers, or "
                "allow more open files and processes (ulimit -n, ulimit -u)"
            ) from error
        self._waiting[worker] = scene
        self._let_begin()
        return worker

    def _let_begin(self) -> None:
        """Lets all begin if the machine code is compiled; else one, which compiles it."""
        for worker, scene in list(self._waiting.items()):
            if self._compiled or not self._begun:
                worker.begin(scene.requires if scene else None)
                self._begun.add(worker)
                del self._waiting[worker]

    def hand_over(self, worker: WorkerProcess, job: Job) -> None:
        """Sends it a job."""
        worker.hand_over(job)

    def listen(self, workers: Sequence[WorkerProcess]) -> list[tuple[WorkerProcess, WorkerMessage]]:
        """Reads what the processes have sent, and finds the dead and those that take too long."""
        wait([end for w in workers for end in (w.connection, w.sentinel)], timeout=PAUSE_S)
        told = [(worker, message) for worker in workers for message in worker.receive()]
        done = any(isinstance(message, Driven) or message == Compiling() for _, message in told)
        self._compiled = self._compiled or done
        self._let_begin()
        return told

    def check(self, first: RunFacts, other: RunFacts) -> None:
        """One machine gives the same bits."""

    def dismiss(self, worker: WorkerProcess) -> None:
        """Kills it."""
        self._begun.discard(worker)
        self._waiting.pop(worker, None)
        worker.stop()
