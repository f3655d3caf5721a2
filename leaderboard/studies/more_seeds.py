"""A run that gets more seeds: its routes stay as they are, and find their places among more.

A run's jobs are numbered over routes and seeds, and every file of it names the run, so all of it is
written anew beside the old one, which is then replaced in two renames. Whatever stops that, one of
the two is there whole.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from leaderboard.records.own_files import remove_run
from leaderboard.records.record import RunRecord
from leaderboard.records.results import write_run
from leaderboard.running.jobs import plan_jobs


def with_seeds(run: RunRecord, route_ids: Sequence[str], seeds: Sequence[int]) -> RunRecord:
    """The run over these seeds, with the routes that it has driven.

    Args:
        run: The run.
        route_ids: All of its routes.
        seeds: Its own and more.
    """
    jobs = plan_jobs(route_ids, seeds)
    places = {(job.route_id, job.seed): job.index for job in jobs}
    routes = [
        dataclasses.replace(record, index=places[record.route_id, record.seed])
        for record in run.routes
    ]
    routes.sort(key=lambda record: record.index)
    return dataclasses.replace(run, seeds=tuple(seeds), planned=len(jobs), routes=tuple(routes))


def replace_run(folder: Path, run: RunRecord) -> None:
    """Puts a run in the place of the one that the folder holds; what else is there stays there."""
    new, old = _beside(folder, "new"), _beside(folder, "old")
    recover_run(folder)
    write_run(new, run)
    folder.rename(old)
    new.rename(folder)
    _clear_up(old, folder)


def recover_run(folder: Path) -> None:
    """Clears up after a `replace_run` that was killed: the folder holds the old or the new run."""
    new, old = _beside(folder, "new"), _beside(folder, "old")
    if old.is_dir() and not folder.is_dir():
        old.rename(folder)
    for leftover in (new, old):
        if leftover.is_dir():
            _clear_up(leftover, folder)


def _clear_up(leftover: Path, folder: Path) -> None:
    """Removes a run's files with the folder that they were in; moves what else it holds on."""
    remove_run(leftover)
    for path in list(leftover.iterdir()):
        if not (folder / path.name).exists():
            path.rename(folder / path.name)
    if not any(leftover.iterdir()):
        leftover.rmdir()


def _beside(folder: Path, what: str) -> Path:
    return folder.with_name(f".{folder.name}.{what}")
