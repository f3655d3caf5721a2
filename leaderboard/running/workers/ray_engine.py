"""Drives on a Ray cluster: the same workers, each held by an actor on whichever machine has room.

An actor does for its worker what `WorkerProcess` does here: it hands over jobs, watches the clock
and kills. Bits are equal on equal footing only, so a machine whose CPU or versions are not those of
the first worker is refused.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import signal
from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

from agents.base import Requirements
from agents.import_folders import path_without_agents
from leaderboard.records.footing import record_differences
from leaderboard.records.record import WORKER_DIED
from leaderboard.running.jobs import Job, RunSpec, SetupError
from leaderboard.running.messages import (
    Died,
    Driven,
    EngineEvent,
    Ready,
    Refused,
    RunFacts,
    Warned,
    WorkerMessage,
)
from leaderboard.running.wall_clock import Limits
from leaderboard.running.workers.scheduler import PAUSE_S, Scheduler
from leaderboard.running.workers.worker_process import WorkerProcess

WITHOUT_RAY = "--engine ray needs Ray: pip install 'driveinsight[ray]'"


class RayWorker:
    """An actor: one worker process on the actor's machine."""

    def __init__(self, spec: RunSpec, limits: Limits, requires: Requirements | None) -> None:
        self._worker = WorkerProcess(spec, limits)
        self._worker.begin(requires)

    def set_up(self) -> list[WorkerMessage]:
        """Waits for the worker to be ready; what it told, the last that it is or cannot be."""
        return self._listen(Ready, Refused, Died)

    def drive(self, job: Job) -> list[WorkerMessage]:
        """Has a job driven; what the worker told, the last what became of the job."""
        self._worker.hand_over(job)
        return self._listen(Driven, Died)

    def _listen(self, *last: type) -> list[WorkerMessage]:
        told: list[WorkerMessage] = []
        while not (told and isinstance(told[-1], last)):
            wait([self._worker.connection, self._worker.sentinel], timeout=PAUSE_S)
            told += [m for m in self._worker.receive() if isinstance(m, (*last, Warned))]
        return told


@dataclass(kw_only=True, eq=False)
class _Held:
    """An actor as the driver holds it, and what it was asked last; None once it has answered."""

    actor: Any
    asked: Any


@dataclass(frozen=True, kw_only=True)
class RayEngine:
    """Jobs shared out among `workers` actors.

    Attributes:
        address: Of a running cluster, such as `auto` or `ray://head:10001`; None starts one on
            this machine, and ends it.
    """

    workers: int = 1
    limits: Limits = field(default_factory=Limits)
    address: str | None = None

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise ValueError(f"an engine needs at least 1 worker, not {self.workers}")

    def run(self, spec: RunSpec, jobs: deque[Job]) -> Generator[EngineEvent]:
        """See `local_engine.Engine.run`."""
        with cluster(self.workers, self.address) as ray:
            crew = _Actors(ray, _absolute(spec), self.limits)
            yield from Scheduler(crew, self.workers, jobs).run()


class _Actors:
    """The actors of one run; see `Crew`."""

    def __init__(self, ray: Any, spec: RunSpec, limits: Limits) -> None:
        self._ray, self._spec, self._limits = ray, spec, limits
        self._actor_class = ray.remote(num_cpus=1, max_restarts=0)(RayWorker)

    def hire(self, scene: RunFacts | None) -> _Held:
        """Starts an actor, wherever there is room."""
        requires = scene.requires if scene else None
        actor = self._actor_class.remote(self._spec, self._limits, requires)
        return _Held(actor=actor, asked=actor.set_up.remote())

    def hand_over(self, worker: _Held, job: Job) -> None:
        """Asks the actor to drive a job."""
        worker.asked = worker.actor.drive.remote(job)

    def listen(self, workers: Sequence[_Held]) -> list[tuple[_Held, WorkerMessage]]:
        """Takes an answer, if there is one."""
        asked = {held.asked: held for held in workers if held.asked is not None}
        answered, _ = self._ray.wait(list(asked), num_returns=1, timeout=PAUSE_S)
        told = []
        for reference in answered:
            held = asked[reference]
            held.asked = None
            told += [(held, message) for message in self._answer(reference)]
        return told

    def _answer(self, reference: Any) -> list[WorkerMessage]:
        """What an actor told; of one whose process or machine is gone, that it is."""
        try:
            told: list[WorkerMessage] = self._ray.get(reference)
        except self._ray.exceptions.RayError as error:
            return [Died(status=WORKER_DIED, reason=f"the Ray worker is gone: {_brief(error)}")]
        return told

    def check(self, first: RunFacts, other: RunFacts) -> None:
        """Machines of a cluster may be unlike."""
        check_footing(first, other)

    def dismiss(self, worker: _Held) -> None:
        """Kills the actor, and with it its worker."""
        self._ray.kill(worker.actor)


def check_footing(first: RunFacts, other: RunFacts) -> None:
    """Refuses a machine that would give other bits.

    Raises:
        SetupError: If its CPU, versions, map, routes or agent are not those of the first worker.
    """
    # Only the first asked an agent, and so knows which packages it loads
    versions = {name: found for name, found in other.versions.items() if name in first.versions}
    other = dataclasses.replace(other, versions=versions)
    fields = ("cpu", "versions", "town_hash", "routes_hash", "world", "agent_version")
    if found := record_differences(first, other, fields):
        said = "; ".join(difference.is_not for difference in found)
        raise SetupError(
            f"machines of the cluster differ ({said}), so the same route would not give the same "
            "bits: use machines that are alike, with the same packages and files"
        )


def _brief(error: Exception) -> str:
    """The line of Ray's report that says what happened: an exception's last, else the first."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1] if "Error: " in lines[-1] else lines[0]


def _absolute(spec: RunSpec) -> RunSpec:
    """The run with paths that are good in another working folder."""
    options = {
        name: str(Path(value).resolve()) if _is_path(value) else value
        for name, value in spec.options.items()
    }
    agent = ":".join(str(Path(p).resolve()) if _is_path(p) else p for p in spec.agent.split(":"))
    return dataclasses.replace(spec, agent=agent, options=options)


def _is_path(value: Any) -> bool:
    return isinstance(value, str | Path) and "." in str(value) and Path(value).exists()


def _own_cluster(workers: int) -> dict[str, Any]:
    """Options of a cluster of this machine, which finds the modules that are found here."""
    modules = os.pathsep.join(str(Path(place).resolve()) for place in path_without_agents())
    return {
        "num_cpus": workers,
        "include_dashboard": False,
        "runtime_env": {"env_vars": {"PYTHONPATH": modules}},
    }


@contextlib.contextmanager
def cluster(workers: int, address: str | None) -> Generator[Any]:
    """Ray, connected for as long as this lasts; see `RayEngine` for what it is told.

    Within another, it is that one's connection.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # Ray asks nothing else, as it loads
    try:
        import ray
    except ImportError as error:
        raise SetupError(WITHOUT_RAY) from error
    if ray.is_initialized():
        yield ray
        return
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    local = {} if address else _own_cluster(workers)
    try:
        ray.init(
            address=address or "local",
            log_to_driver=False,
            logging_level="error",
            **local,
        )
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise SetupError(f"there is no Ray cluster at '{address}': {error}") from error
    try:
        with contextlib.suppress(ValueError):  # only the main thread has handlers
            for number, handler in handlers.items():
                signal.signal(number, handler)  # Ray has put its own in their place
        yield ray
    finally:
        ray.shutdown()
