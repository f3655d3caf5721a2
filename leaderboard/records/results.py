"""Result files of a run: one for the run, one a route, and CARLA's `results.json` beside them.

    RUN/driveinsight.json   what was asked for: agent, options, seeds, rules, versions, CPU, town
    RUN/routes/0007.json    one route driven once, whole: score, events, controls, trace, hashes
    RUN/results.json        the table of all routes so far, in CARLA's schema

The run's file is written once and each route's once, and the table, which is all routes again, ever
more rarely: a run of ten thousand routes does no more for the last than for the first. Every file
is replaced in one step: a reader, or whoever resumes after a kill, finds a route whole or not at
all. A route's file names the run it belongs to by a hash of the run's file, so routes of two runs
are never counted together.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeVar

from di_envs.files.json_text import (
    ForeignError,
    JsonError,
    by_lines,
    compact,
    indented,
    read_document,
)
from di_envs.files.whole import write_whole
from leaderboard.records.carla.results import carla_results
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.records.run_json import (
    FORMAT,
    FORMAT_VERSION,
    ROUTE_FORMAT,
    route_from_json,
    route_to_json,
    run_from_json,
    run_hash,
    run_to_json,
)

CARLA_FILE = "results.json"
RECORD_FILE = "driveinsight.json"
ROUTES_FOLDER = "routes"
ROUTE_FILE = r"[0-9]{4,}\.json"  # a pattern for the names of those in it

_TABLES = 16  # of the routes so far, one in so many brings a new table

_Value = TypeVar("_Value")


class ResultsError(Exception):
    """A result folder or file that cannot be used; the message says what to do."""


class DamagedError(ResultsError):
    """A file of ours that is cut short or garbled."""


def write_run(folder: Path, run: RunRecord) -> None:
    """Writes a run with all its routes, into a folder that is made if need be.

    Raises:
        ResultsError: If the folder cannot be written to.
    """
    _write(folder, lambda: folder.mkdir(parents=True, exist_ok=True))
    start_run(folder, run)
    for record in run.routes:
        _write(folder, partial(_write_route, folder, run, record))


def start_run(folder: Path, run: RunRecord) -> None:
    """Writes a run's own file and CARLA's, but no route.

    Raises:
        ResultsError: If the folder cannot be written to.
    """
    _write(folder, lambda: write_whole(folder / RECORD_FILE, indented(run_to_json(run))))
    write_table(folder, run)


def add_route(folder: Path, run: RunRecord, record: RouteRecord) -> None:
    """Writes one more route of a run that was started, and CARLA's table when that is due.

    It may lack the last routes, one in 16 at most: `write_table` when there are no more.

    Args:
        folder: The run's.
        run: The run, of which `record` is already one of `routes`.
        record: The route just finished.

    Raises:
        ResultsError: If the folder cannot be written to.
    """
    _write(folder, partial(_write_route, folder, run, record))
    if len(run.routes) % max(len(run.routes) // _TABLES, 1) == 0:
        write_table(folder, run)


def write_table(folder: Path, run: RunRecord) -> None:
    """Writes CARLA's `results.json`, which is made of the rest.

    Raises:
        ResultsError: If the folder cannot be written to.
    """
    _write(folder, lambda: write_whole(folder / CARLA_FILE, indented(carla_results(run))))


def _write(folder: Path, write: Callable[[], None]) -> None:
    try:
        write()
    except OSError as error:
        raise ResultsError(f"cannot write results to {folder} ({error.strerror})") from error


def _write_route(folder: Path, run: RunRecord, record: RouteRecord) -> None:
    content = {
        "format": ROUTE_FORMAT,
        "format_version": FORMAT_VERSION,
        "run": run_hash(run),
        **route_to_json(record),
    }
    text = by_lines({name: compact(value) for name, value in content.items()})
    write_whole(folder / ROUTES_FOLDER / f"{record.index:04d}.json", text)


def route_files(folder: Path) -> list[Path]:
    """The files of those routes of a run that are finished, by their index."""
    files = (folder / ROUTES_FOLDER).glob("[0-9]*.json")
    ours = (path for path in files if re.fullmatch(ROUTE_FILE, path.name))
    return sorted(ours, key=lambda path: int(path.stem))


def run_folder(path: Path) -> Path:
    """The folder of a run that is given by it, or by `driveinsight.json` or `results.json` in it.

    Raises:
        ResultsError: If there is no run.
    """
    folder = path.parent if path.name in (RECORD_FILE, CARLA_FILE) else path
    if not (folder / RECORD_FILE).is_file():
        raise ResultsError(
            f"there is no {folder / RECORD_FILE}: give the folder that "
            "`driveinsight evaluate --output` wrote"
        )
    return folder


def read_run(path: Path) -> RunRecord:
    """Reads a run with all its finished routes.

    Args:
        path: Its folder, or `driveinsight.json` or `results.json` in it.

    Raises:
        ResultsError: If there is no such run, or one of its files is half-written, foreign, of
            another format version, or of another run.
    """
    folder = run_folder(path)
    run = read_head(folder)
    records = tuple(read_route(file, run) for file in route_files(folder))
    return dataclasses.replace(run, routes=records)


def read_head(folder: Path) -> RunRecord:
    """Reads what was asked for of the run in a folder, and none of its routes.

    Raises:
        ResultsError: As `read_run`.
    """
    path = folder / RECORD_FILE
    return _sound(lambda: run_from_json(read_document(path, FORMAT, FORMAT_VERSION), str(path)))


def read_route(file: Path, run: RunRecord) -> RouteRecord:
    """Reads one route of a run.

    Raises:
        DamagedError: If the file is cut short or garbled.
        ResultsError: If it is foreign, of another format version, or of another run.
    """
    content = _sound(lambda: read_document(file, ROUTE_FORMAT, FORMAT_VERSION))
    if content.pop("run", None) != run_hash(run):
        raise ResultsError(
            f"{file} belongs to another run than the {RECORD_FILE} beside it: put the file of its "
            "own run there, or remove it and continue with `driveinsight evaluate --resume`"
        )
    record = _sound(lambda: route_from_json(content, str(file)))
    if file.stem != f"{record.index:04d}" or record.index >= run.planned:
        raise ResultsError(f"{file} holds route number {record.index}: it was renamed")
    if record.seed not in run.seeds:
        raise ResultsError(f"{file} is of seed {record.seed}, which the run does not have")
    return record


def _sound(read: Callable[[], _Value]) -> _Value:
    """What is read of a file of ours; else an error that says what to do."""
    try:
        return read()
    except ForeignError as error:
        raise ResultsError(
            f"{error}: give the folder that `driveinsight evaluate --output` wrote, or read it "
            "with the version that wrote it"
        ) from error
    except JsonError as error:
        raise DamagedError(
            f"{error}: fetch it again from where it came, or remove it and evaluate again"
        ) from error
