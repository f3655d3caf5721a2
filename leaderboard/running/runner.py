"""Evaluates an agent over routes and seeds: jobs out, records in, a file for each as it is done.

An engine says what became of each job; what follows from that is decided here. A route that the
machinery lost is tried once more, then recorded as lost. Whatever stops the run, what was finished
by then is on disk, and a later process continues from there.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import closing
from enum import Enum
from pathlib import Path
from typing import Any

from rich.console import Console

from di_envs.suite_files import from_anywhere
from di_envs.suites import Suite
from leaderboard.records.folder_lock import folder_lock
from leaderboard.records.own_files import prepare_folder, take_away
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.records.results import add_route, start_run, write_table
from leaderboard.records.resuming import resumed
from leaderboard.running.agent_place import drives_apart
from leaderboard.running.displays.run import RunDisplay
from leaderboard.running.interruption import interruptible
from leaderboard.running.jobs import Job, RunSpec, plan_jobs
from leaderboard.running.messages import (
    Compiling,
    Driven,
    EngineEvent,
    Lost,
    Ready,
    RunFacts,
    Started,
    Warned,
)
from leaderboard.running.terminal import Terminal
from leaderboard.running.workers.local_engine import Engine, LocalEngine


class Existing(Enum):
    """What to do with results that the folder holds already."""

    REFUSE = "refuse"
    OVERWRITE = "overwrite"
    RESUME = "resume"


def evaluate(
    spec: RunSpec,
    seeds: Sequence[int],
    *,
    suite: Suite,
    folder: Path,
    engine: Engine | None = None,
    existing: Existing = Existing.REFUSE,
    console: Console | None = None,
    display: RunDisplay | None = None,
) -> RunRecord:
    """Drives every route of the environment with every seed; writes each as it is finished.

    Args:
        spec: The agent, the environment's options and the rules.
        seeds: Each gives every route a world of its own; see `Job.world_seed`.
        suite: The set of routes that the options name.
        folder: Where the files go; see `results`.
        engine: Where the routes are driven; None for one process beside this one.
        existing: What to do with results in the folder.
        console: Where progress is shown.
        display: What shows it; None for that of a single run.

    Returns:
        The run; not `complete` if it was interrupted (SIGINT or SIGTERM).

    Raises:
        SetupError: If the agent or an option is wrong.
        ResultsError: If the folder cannot be written to, is in use, holds results that are not
            to be replaced, or results that this run cannot continue.
    """
    console = console or Terminal(stderr=True)
    with folder_lock(folder), interruptible() as interruption:
        prepare_folder(
            folder,
            overwrite=existing is Existing.OVERWRITE,
            resume=existing is Existing.RESUME,
        )
        with display or RunDisplay(console) as shown:
            evaluation = _Evaluation(
                spec=spec,
                seeds=seeds,
                suite=suite,
                folder=folder,
                resume=existing is Existing.RESUME,
                display=shown,
            )
            engine = engine or LocalEngine()
            with closing(engine.run(spec, evaluation.jobs)) as events:
                for event in events:
                    evaluation.take(event)
                    if interruption.requested:
                        break
        run = evaluation.run
        if run is None:  # stopped before it was known what there is to drive
            raise KeyboardInterrupt
        write_table(folder, run)
        if interruption.requested:
            console.print(f"interrupted: {len(run.routes)} of {run.planned} routes are kept")
        return run


class _Evaluation:
    """The books of a run: what is to do, what is done, what is tried again."""

    def __init__(
        self,
        *,
        spec: RunSpec,
        seeds: Sequence[int],
        suite: Suite,
        folder: Path,
        resume: bool,
        display: RunDisplay,
    ) -> None:
        self._spec, self._seeds, self._suite = spec, seeds, suite
        self._folder, self._resume, self._display = folder, resume, display
        self._again: set[int] = set()
        self._told: set[str] = set()
        self.jobs: deque[Job] = deque()
        self.run: RunRecord | None = None

    def take(self, event: EngineEvent) -> None:
        """Does what an engine's event asks for."""
        match event:
            case Ready(scene=scene):
                self._begin(scene)
            case Started(job=job):
                self._display.started(job)
            case Driven(job=job, record=record):
                if not (record.lost and self._try_again(job, record.status, record.reason)):
                    self._keep(record)
            case Lost(job=job, status=status, reason=reason):
                if not self._try_again(job, status, reason):
                    self._keep(_lost_record(job, status, reason))
            case Compiling():
                self._display.compiling(event)
            case Warned(text=text):
                self._told.add(text)
                warnings.warn(text, stacklevel=2)

    def _begin(self, scene: RunFacts) -> None:
        jobs = plan_jobs(scene.route_ids, self._seeds)
        run = new_run(self._spec, jobs, self._suite, scene)
        if self._resume:
            run = resumed(self._folder, run)
        else:  # nothing is there, or what is to be replaced; now that a run can begin
            take_away(self._folder)
        start_run(self._folder, run)
        done = {record.index for record in run.routes}
        self.run = run
        self.jobs.extend(job for job in jobs if job.index not in done)
        for note in run.notes:
            if note not in self._told:
                self._display.say(note)
        self._display.plan(len(jobs), len(done))

    def _try_again(self, job: Job, status: str, reason: str) -> bool:
        """Queues a job that the machinery lost; False if it has been tried again before."""
        if job.index in self._again:
            return False
        self._again.add(job.index)
        self.jobs.append(job)
        self._display.again(job, status, reason)
        return True

    def _keep(self, record: RouteRecord) -> None:
        assert self.run is not None
        self.run = with_route(self.run, record)
        add_route(self._folder, self.run, record)
        self._display.finished(record)


def _lost_record(job: Job, status: str, reason: str) -> RouteRecord:
    from leaderboard.running.finished_route import lost_record  # loads what only workers need

    return dataclasses.replace(lost_record(job, reason), status=status)


def new_run(spec: RunSpec, jobs: Sequence[Job], suite: Suite, scene: RunFacts) -> RunRecord:
    """A run of which nothing is driven yet."""
    asked = scene.requires.as_json()
    return RunRecord(
        rules=spec.rules,
        agent=spec.agent,
        agent_version=scene.agent_version,
        track=str(scene.requires.track),
        requires={name: value for name, value in asked.items() if name != "branchable"},
        suite=suite.name,
        suite_version=suite.version,
        options={name: _as_json(value) for name, value in from_anywhere(spec.options).items()},
        town=scene.town,
        town_hash=scene.town_hash,
        routes_hash=scene.routes_hash,
        seeds=tuple(dict.fromkeys(job.seed for job in jobs)),
        versions=scene.versions,
        cpu=scene.cpu,
        planned=len(jobs),
        interventions=tuple(map(str, spec.interventions)),
        world=scene.world,
        isolated=drives_apart(spec, scene.requires),
        refused=dict(scene.refused),
        notes=scene.notes,
    )


def _as_json(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return [_as_json(item) for item in value]
    if isinstance(value, Mapping):
        return {name: _as_json(item) for name, item in value.items()}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _as_json(dataclasses.asdict(value))  # a rig or a LiDAR of one's own
    return str(value) if isinstance(value, Path) else value


def with_route(run: RunRecord, record: RouteRecord) -> RunRecord:
    """The run with one more record, in the order of the jobs whatever finished first."""
    routes = sorted((*run.routes, record), key=lambda record: record.index)
    return dataclasses.replace(run, routes=tuple(routes))
