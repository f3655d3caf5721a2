"""Evaluates an agent over routes and seeds: jobs out, records in, files kept up to date.

Whatever stops the run, Ctrl-C included, what was finished by then is on disk and in the table.
"""

from __future__ import annotations

import dataclasses
import signal
import threading
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from di_envs.kernels import cpu_capability
from di_envs.suites import Suite
from leaderboard.engines import Engine, PoolEngine, SerialEngine
from leaderboard.jobs import Job, RunSpec, plan_jobs
from leaderboard.record import RouteRecord, RunRecord
from leaderboard.results import add_route, start_run
from leaderboard.versions import package_versions
from leaderboard.warm_up import Scene, warm_up


def evaluate(
    spec: RunSpec,
    seeds: Sequence[int],
    *,
    suite: Suite,
    folder: Path,
    workers: int = 1,
    console: Console | None = None,
) -> RunRecord:
    """Drives every route of the environment with every seed; writes the files after each.

    Args:
        spec: The agent, the environment's options and the rules.
        seeds: Each gives every route a world of its own; see `Job.world_seed`.
        suite: The set of routes that the options name.
        folder: Where the files go; see `results.prepare_folder`.
        workers: Number of processes; 1 drives in this one.
        console: Where progress is shown.

    Returns:
        The run; not `complete` if it was interrupted (SIGINT or SIGTERM).

    Raises:
        SetupError: If the agent or an option is wrong.
        ResultsError: If the folder cannot be written to.
    """
    console = console or Console(stderr=True)
    with _sigterm_as_ctrl_c():
        scene = warm_up(spec, console)
        jobs = plan_jobs(scene.route_ids, seeds)
        run = new_run(spec, jobs, suite, scene)
        start_run(folder, run)
        engine: Engine = SerialEngine() if workers == 1 else PoolEngine(workers=workers)
        try:
            with closing(_driven(engine, spec, jobs, console)) as records:
                for record in records:
                    run = with_route(run, record)
                    add_route(folder, run, record)
        except KeyboardInterrupt:
            console.print(f"interrupted: {len(run.routes)} of {run.planned} routes are kept")
    return run


def _driven(
    engine: Engine, spec: RunSpec, jobs: Sequence[Job], console: Console
) -> Generator[RouteRecord]:
    """The engine's records, with a progress bar and a line for each route that crashed."""
    progress = Progress(
        TextColumn("  driving  "),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
        console=console,
    )
    with progress, closing(engine.run(spec, jobs)) as records:
        task = progress.add_task("", total=len(jobs))
        for record in records:
            what = f"route {record.route_id}, seed {record.seed}"
            if record.crashed:
                progress.print(f"[red]{what}: {record.status}[/red]: {record.reason}")
            score = record.score.driving_score
            progress.update(task, advance=1, description=f"{what}: DS {score:.1f}")
            yield record


def new_run(spec: RunSpec, jobs: Sequence[Job], suite: Suite, scene: Scene) -> RunRecord:
    """A run of which nothing is driven yet."""
    requires = scene.requires
    return RunRecord(
        rules=spec.rules,
        agent=spec.agent,
        track=str(requires.track),
        requires={
            "observations": list(requires.observations),
            "control_dt_s": requires.control_dt_s,
            "privileged": requires.privileged,
            "options": _as_json(requires.options),
        },
        suite=suite.name,
        suite_version=suite.version,
        options={name: _as_json(value) for name, value in spec.options.items()},
        town=scene.town,
        town_hash=scene.town_hash,
        seeds=tuple(dict.fromkeys(job.seed for job in jobs)),
        versions=package_versions(),
        cpu=cpu_capability(),
        planned=len(jobs),
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


@contextmanager
def _sigterm_as_ctrl_c() -> Iterator[None]:
    """Makes SIGTERM stop the run as Ctrl-C does, so that batch systems lose nothing either."""
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread may set handlers
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
