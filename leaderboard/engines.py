"""Where jobs run: in this process, or in a pool of processes. The results are the same bits.

Each worker builds its own environment and is handed one job at a time. A worker that dies costs
its own job and is replaced. On Ctrl-C only the parent stops: it keeps what is finished.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import warnings
from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Protocol

from leaderboard.jobs import Job, RunSpec
from leaderboard.record import RouteRecord


class Engine(Protocol):
    """Drives all jobs and gives each record as it is finished, in any order."""

    def run(self, spec: RunSpec, jobs: Sequence[Job]) -> Generator[RouteRecord]: ...


class SerialEngine:
    """One job after another in this process."""

    def run(self, spec: RunSpec, jobs: Sequence[Job]) -> Generator[RouteRecord]:
        from leaderboard.driver import Driver

        with Driver(spec) as driver:
            for job in jobs:
                yield driver.drive(job)


@dataclass(kw_only=True)
class _Worker:
    process: SpawnProcess
    connection: Connection
    job: Job | None = None


@dataclass(frozen=True, kw_only=True)
class PoolEngine:
    """Jobs shared out among `workers` fresh processes."""

    workers: int

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise ValueError(f"a pool needs at least 1 worker, not {self.workers}")

    def run(self, spec: RunSpec, jobs: Sequence[Job]) -> Generator[RouteRecord]:
        waiting, pool = deque(jobs), list[_Worker]()
        try:
            while waiting and len(pool) < self.workers:
                pool.append(_start_worker(spec, waiting.popleft()))
            while pool:
                ready = wait([worker.connection for worker in pool])
                for worker in [worker for worker in pool if worker.connection in ready]:
                    yield _receive(worker)
                    if worker.job is None and waiting:
                        _hand_over(worker, waiting.popleft())
                        continue
                    pool.remove(worker)
                    _stop(worker)
                    if waiting:  # only a dead worker leaves while there is work
                        pool.append(_start_worker(spec, waiting.popleft()))
        finally:
            for worker in pool:
                _stop(worker)


def _start_worker(spec: RunSpec, job: Job) -> _Worker:
    """Starts a process with Ctrl-C blocked from birth: it must not die of it while it loads."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, spec), daemon=True)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    theirs.close()
    worker = _Worker(process=process, connection=ours)
    _hand_over(worker, job)
    return worker


def _hand_over(worker: _Worker, job: Job) -> None:
    worker.job = job
    with contextlib.suppress(OSError):  # a dead worker's pipe says so when we wait for it
        worker.connection.send(job)


def _receive(worker: _Worker) -> RouteRecord:
    """The record that a worker sends; for a dead worker one that says so, and its job remains."""
    job = worker.job
    assert job is not None
    try:
        record: RouteRecord = worker.connection.recv()
    except (EOFError, OSError):
        from leaderboard.episode_log import lost_record

        worker.process.join()
        return lost_record(job, f"the worker process {_death(worker.process.exitcode)}")
    worker.job = None
    return record


def _death(exitcode: int | None) -> str:
    if exitcode is not None and exitcode < 0:
        return f"was killed by {signal.Signals(-exitcode).name}"
    return f"ended by itself with exit code {exitcode}"


def _stop(worker: _Worker) -> None:
    worker.connection.close()
    if worker.job is None:
        worker.process.join(timeout=5.0)  # idle: it ends when its pipe closes
    worker.process.terminate()
    worker.process.join()
    worker.process.close()


def _serve(connection: Connection, spec: RunSpec) -> None:
    """A worker's life: build the environment, drive what it is handed until the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore", UserWarning)  # the parent has shown them as it warmed up
    from leaderboard.driver import Driver

    with Driver(spec) as driver, contextlib.suppress(EOFError, OSError):  # the parent is done
        while True:
            job: Job = connection.recv()
            connection.send(driver.drive(job))
