"""Which job is driven next, by whom, and when the run is over: one scheduler for all engines.

An engine brings a crew: how a worker is started, told, heard and ended. What becomes of a lost job
is not decided here: who handles the events may add it to the queue once more, see `runner`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from leaderboard.running.jobs import Job, SetupError
from leaderboard.running.messages import (
    Died,
    Driven,
    EngineEvent,
    Lost,
    Pause,
    Ready,
    Refused,
    Scene,
    Started,
    WorkerMessage,
)

PAUSE_S = 0.25  # longest time without an event
_MOST_NEVER_READY = 5  # workers that die as they start: a fault that will not go away

W = TypeVar("W")


class Crew(Protocol[W]):
    """Workers of one kind, each a process that sets the run up and then drives one job a time."""

    def hire(self, scene: Scene | None) -> W:
        """Starts a worker; with no scene it is the one that finds out what there is to drive."""
        ...

    def hand_over(self, worker: W, job: Job) -> None:
        """Has a worker drive a job."""
        ...

    def listen(self, workers: Sequence[W]) -> list[tuple[W, WorkerMessage]]:
        """What workers told, waiting `PAUSE_S` at most; `Died` is the last that one tells."""
        ...

    def check(self, first: Scene, other: Scene) -> None:
        """Refuses a worker that would give other bits than the first one.

        Raises:
            SetupError: If it would.
        """
        ...

    def dismiss(self, worker: W) -> None:
        """Ends a worker, dead or alive, at once."""
        ...


@dataclass(kw_only=True, eq=False)
class _Hired(Generic[W]):
    """A worker, whether it is ready to drive, and what it was handed and has not finished."""

    worker: W
    ready: bool = False
    job: Job | None = None


class Scheduler(Generic[W]):
    """Shares the jobs of one run out among the workers of a crew."""

    def __init__(self, crew: Crew[W], workers: int, jobs: deque[Job]) -> None:
        """Begins with nobody.

        Args:
            crew: Whose workers drive.
            workers: How many there are at most.
            jobs: Taken from the left; there may come more as long as the run is not over.
        """
        self._crew, self._most, self._jobs = crew, workers, jobs
        self._hired: list[_Hired[W]] = []
        self._scene: Scene | None = None
        self._never_ready = 0

    def run(self) -> Generator[EngineEvent]:
        """Drives all jobs; see `Engine.run`."""
        try:
            self._hire()
            while not self._over:
                yield from self._share_out()
                yield from self._listen()
        finally:
            for hired in self._hired:
                self._crew.dismiss(hired.worker)

    @property
    def _over(self) -> bool:
        """Whether all is driven."""
        return self._scene is not None and not self._busy and not self._jobs

    @property
    def _busy(self) -> int:
        return sum(hired.job is not None for hired in self._hired)

    def _hire(self) -> None:
        self._hired.append(_Hired(worker=self._crew.hire(self._scene)))

    def _share_out(self) -> Generator[EngineEvent]:
        """Hires as many workers as there is work for; gives jobs to those that are ready."""
        if self._scene is None:
            return
        while len(self._hired) < min(self._most, self._busy + len(self._jobs)):
            self._hire()
        for hired in self._hired:
            if hired.ready and hired.job is None and self._jobs:
                hired.job = self._jobs.popleft()
                self._crew.hand_over(hired.worker, hired.job)
                yield Started(job=hired.job)

    def _listen(self) -> Generator[EngineEvent]:
        """Tells what the workers tell, or that there was nothing for a while."""
        told = self._crew.listen([hired.worker for hired in self._hired])
        if not told:
            yield Pause()
        for worker, message in told:
            hired = next(each for each in self._hired if each.worker is worker)
            yield from self._take(hired, message)

    def _take(self, hired: _Hired[W], message: WorkerMessage) -> Generator[EngineEvent]:
        match message:
            case Ready(scene=scene):
                hired.ready = True
                if self._scene is None:
                    self._scene = scene
                    yield message
                self._crew.check(self._scene, scene)
            case Refused(reason=reason):
                raise SetupError(reason)
            case Died():
                yield from self._bury(hired, message)
            case Driven():
                hired.job = None
                yield message
            case _:
                yield message

    def _bury(self, hired: _Hired[W], death: Died) -> Generator[EngineEvent]:
        """Lets a dead worker go; another takes its place, unless too many never got ready."""
        self._hired.remove(hired)
        self._crew.dismiss(hired.worker)
        self._never_ready += not hired.ready
        if self._scene is None or self._never_ready > _MOST_NEVER_READY:
            raise SetupError(f"the run cannot be set up: {death.reason}")
        if hired.job is not None:
            yield Lost(job=hired.job, status=death.status, reason=death.reason)
