"""Result files of a run: one for the run, one a route, and CARLA's `results.json` beside them.

    RUN/driveinsight.json   what was asked for: agent, options, seeds, rules, versions, CPU, town
    RUN/routes/0007.json    one route driven once, whole: score, events, controls, trace, hashes
    RUN/results.json        the table of all routes so far, in CARLA's schema

The run's file is written once and each route's once, so a run of a thousand routes writes no more
for the last than for the first. Every file is replaced in one step: a reader, or whoever resumes
after a kill, finds a route whole or not at all. A route's file names the run it belongs to by a
hash of the run's file, so routes of two runs are never counted together.
"""

from __future__ import annotations

import dataclasses
import json
import os
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

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

_Value = TypeVar("_Value")


class ResultsError(Exception):
    """A result folder or file that cannot be used; the message says what to do."""


class DamagedError(ResultsError):
    """A file of ours that is cut short or garbled."""


def prepare_folder(folder: Path, *, overwrite: bool = False, resume: bool = False) -> None:
    """Makes the folder, and makes sure before any work starts that results can be written there.

    Args:
        folder: Where the results are to go.
        overwrite: Take away those of an earlier run.
        resume: Leave them, to be continued.

    Raises:
        ResultsError: If it cannot be written to, or holds results and neither is set.
    """
    for name in (RECORD_FILE, CARLA_FILE):
        if (folder / name).exists() and not (overwrite or resume):
            raise ResultsError(
                f"{folder} already holds {name}: choose another --output, pass --resume to "
                "continue that run, or --overwrite to replace it"
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        _remove_scratch(folder)
        if overwrite:
            _remove_results(folder)
    except OSError as error:
        raise ResultsError(
            f"cannot write results to {folder} ({error.strerror}): choose another --output"
        ) from error


def _remove_scratch(folder: Path) -> None:
    """Takes away what a killed process was writing, and had not finished."""
    for place in (folder, folder / ROUTES_FOLDER):
        for path in place.glob(".*.json.*"):
            path.unlink(missing_ok=True)


def _remove_results(folder: Path) -> None:
    """Takes away an earlier run, its routes last: what is left if that fails is no run at all."""
    for name in (RECORD_FILE, CARLA_FILE):
        (folder / name).unlink(missing_ok=True)
    for path in route_files(folder):
        path.unlink(missing_ok=True)


def route_files(folder: Path) -> list[Path]:
    """The files of those routes of a run that are finished, by their index."""
    return sorted((folder / ROUTES_FOLDER).glob("[0-9]*.json"), key=lambda path: int(path.stem))


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
    _write(folder, lambda: _write_json(folder / RECORD_FILE, run_to_json(run)))
    write_table(folder, run)


def add_route(folder: Path, run: RunRecord, record: RouteRecord) -> None:
    """Writes one more route of a run that was started, then CARLA's table.

    Args:
        folder: The run's.
        run: The run, of which `record` is already one of `routes`.
        record: The route just finished.

    Raises:
        ResultsError: If the folder cannot be written to.
    """
    _write(folder, partial(_write_route, folder, run, record))
    write_table(folder, run)


def write_table(folder: Path, run: RunRecord) -> None:
    """Writes CARLA's `results.json`, which is made of the rest.

    Raises:
        ResultsError: If the folder cannot be written to.
    """
    _write(folder, lambda: _write_json(folder / CARLA_FILE, carla_results(run)))


def _write(folder: Path, write: Callable[[], None]) -> None:
    try:
        write()
    except OSError as error:
        raise ResultsError(f"cannot write results to {folder} ({error.strerror})") from error


def _write_route(folder: Path, run: RunRecord, record: RouteRecord) -> None:
    routes = folder / ROUTES_FOLDER
    routes.mkdir(exist_ok=True)
    content = {
        "format": ROUTE_FORMAT,
        "format_version": FORMAT_VERSION,
        "run": run_hash(run),
        **route_to_json(record),
    }
    lines = (f" {json.dumps(key)}: {_compact(value)}" for key, value in content.items())
    replace_file(routes / f"{record.index:04d}.json", "{\n" + ",\n".join(lines) + "\n}\n")


def _compact(value: Any) -> str:
    return json.dumps(value, allow_nan=False, separators=(",", ":"))


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    replace_file(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def replace_file(path: Path, text: str) -> None:
    """Writes beside the file, then renames: the file is the old or the new one, never half."""
    with tempfile.NamedTemporaryFile(
        "w", encoding="utf-8", dir=path.parent, prefix=f".{path.name}.", delete=False
    ) as file:
        try:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
            os.chmod(file.name, 0o644)  # temporary files are private, results are not
            os.replace(file.name, path)
        except BaseException:
            os.unlink(file.name)
            raise


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
    return _parsed(folder / RECORD_FILE, FORMAT, run_from_json)


def read_route(file: Path, run: RunRecord) -> RouteRecord:
    """Reads one route of a run.

    Raises:
        DamagedError: If the file is cut short or garbled.
        ResultsError: If it is foreign, of another format version, or of another run.
    """
    content = _content(file, ROUTE_FORMAT)
    if content.get("run") != run_hash(run):
        raise ResultsError(
            f"{file} belongs to another run than the {RECORD_FILE} beside it: put the file of its "
            "own run there, or remove it and continue with `driveinsight evaluate --resume`"
        )
    record = _parse(file, content, route_from_json)
    if file.stem != f"{record.index:04d}" or record.index >= run.planned:
        raise ResultsError(f"{file} holds route number {record.index}: it was renamed")
    return record


def _parsed(path: Path, form: str, parse: Callable[[Mapping[str, Any]], _Value]) -> _Value:
    return _parse(path, _content(path, form), parse)


def _content(path: Path, form: str) -> Mapping[str, Any]:
    """The JSON object in a file of ours, whose format and version are right."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_number)
    except (ValueError, OSError) as error:
        raise DamagedError(
            f"{path} is not whole JSON ({error}): fetch it again from where it came, or remove it "
            "and evaluate again"
        ) from error
    if not isinstance(content, dict) or content.get("format") != form:
        raise ResultsError(
            f"{path} is not a {path.name} of ours (its format is not '{form}'): "
            "give the folder that `driveinsight evaluate --output` wrote"
        )
    if content.get("format_version") != FORMAT_VERSION:
        raise ResultsError(
            f"{path} has format version {content.get('format_version')}, this program reads "
            f"{FORMAT_VERSION}: evaluate again, or read it with the version that wrote it"
        )
    return content


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number of JSON")


def _parse(
    path: Path, content: Mapping[str, Any], parse: Callable[[Mapping[str, Any]], _Value]
) -> _Value:
    try:
        return parse(content)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DamagedError(
            f"{path} lacks or garbles a field ({error!r}): evaluate again"
        ) from error
