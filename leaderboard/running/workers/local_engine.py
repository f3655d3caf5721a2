"""Where jobs run: processes of this machine here, a cluster in `ray_engine`. Same bits anywhere.

An engine drives what it is given and tells what became of it. It decides nothing: what is tried
again, kept or shown is for the runner, once for all engines.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Generator
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from typing import Protocol

from leaderboard.running.jobs import Job, RunSpec, SetupError
from leaderboard.running.messages import (
    Compiling,
    Died,
    Driven,
    EngineEvent,
    Lost,
    Pause,
    Ready,
    Refused,
    Scene,
    Started,
)
from leaderboard.running.wall_clock import Limits
from leaderboard.running.workers.worker_process import WorkerProcess

PAUSE_S = 0.25  # longest time without an event


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
        pool = _Pool(self, spec, jobs)
        with contextlib.closing(pool):
            while not pool.done:
                yield from pool.share_out()
                yield from pool.listen()


class _Pool:
    """The processes of one run.

    The first sets the run up and compiles as it begins to drive; the others load their modules
    meanwhile, and begin once the machine code is there to be loaded too.
    """

    def __init__(self, engine: LocalEngine, spec: RunSpec, jobs: deque[Job]) -> None:
        self._engine, self._spec, self._jobs = engine, spec, jobs
        self._scene: Scene | None = None
        self._compiled = False
        self._workers = [WorkerProcess(spec, engine.limits)]
        self._workers[0].begin(None)
        self._begun = {self._workers[0]}

    @property
    def done(self) -> bool:
        """Whether all is driven."""
        idle = all(worker.job is None for worker in self._workers)
        return self._scene is not None and idle and not self._jobs

    def share_out(self) -> Generator[EngineEvent]:
        """Hands jobs to workers that have none, and starts as many as there is work for."""
        if self._scene is None:
            return
        busy = sum(worker.job is not None for worker in self._workers)
        wanted = min(self._engine.workers, busy + len(self._jobs))
        while len(self._workers) < wanted:
            self._workers.append(WorkerProcess(self._spec, self._engine.limits))
        for worker in self._workers:
            if worker.job is None and self._jobs and self._may_begin(worker):
                job = self._jobs.popleft()
                worker.hand_over(job)
                yield Started(job=job)

    def _may_begin(self, worker: WorkerProcess) -> bool:
        """Begins with a worker that has not, if the machine code is compiled."""
        if worker not in self._begun:
            if not self._compiled and len(self._begun) > 0:
                return False
            assert self._scene is not None
            worker.begin(self._scene.requires)
            self._begun.add(worker)
        return True

    def listen(self) -> Generator[EngineEvent]:
        """Tells what the workers tell, or that there was nothing for a while."""
        ready = wait(
            [worker.connection for worker in self._workers]
            + [worker.sentinel for worker in self._workers],
            timeout=PAUSE_S,
        )
        if not ready:
            yield Pause()
        for worker in list(self._workers):
            for message in worker.receive():
                match message:
                    case Ready(scene=scene):
                        if self._scene is None:
                            self._scene = scene
                            yield message
                    case Refused(reason=reason):
                        raise SetupError(reason)
                    case Died():
                        yield from self._bury(worker, message)
                    case Driven():
                        self._compiled = True
                        worker.job = None
                        yield message
                    case _:
                        self._compiled |= message == Compiling()
                        yield message

    def _bury(self, worker: WorkerProcess, death: Died) -> Generator[EngineEvent]:
        self._workers.remove(worker)
        self._begun.discard(worker)
        worker.stop()
        if self._scene is None:
            raise SetupError(f"the run cannot be set up: {death.reason}")
        if worker.job is not None:
            yield Lost(job=worker.job, status=death.status, reason=death.reason)

    def close(self) -> None:
        """Ends all processes."""
        for worker in self._workers:
            worker.stop()
