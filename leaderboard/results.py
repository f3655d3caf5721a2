"""Result files: CARLA's `results.json` and, beside it, our fuller `driveinsight.json`.

Both are replaced in one step, so a reader never sees half a file. Ours says all that a rerun needs
to give the same bits: agent, options, seeds, versions, CPU capability, town and routes.
"""

from __future__ import annotations

import dataclasses
import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from di_envs.world.state import EventKind
from leaderboard.carla_results import carla_results
from leaderboard.record import Bound, EventRecord, RouteRecord, RunRecord
from leaderboard.score import Score

CARLA_FILE = "results.json"
RECORD_FILE = "driveinsight.json"
FORMAT = "driveinsight-run"
FORMAT_VERSION = 1


class ResultsError(Exception):
    """A result folder or file that cannot be used; the message says what to do."""


def prepare_folder(folder: Path, *, overwrite: bool = False) -> None:
    """Makes the folder, and makes sure before any work starts that results can be written there.

    Raises:
        ResultsError: If it cannot be written to, or holds results and `overwrite` is not set.
    """
    for name in (RECORD_FILE, CARLA_FILE):
        if (folder / name).exists() and not overwrite:
            raise ResultsError(
                f"{folder} already holds {name}: choose another --output, or pass --overwrite"
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ResultsError(
            f"cannot write results to {folder} ({error.strerror}): choose another --output"
        ) from error


def write_run(folder: Path, run: RunRecord) -> None:
    """Writes both files of a run, whole or in progress.

    Raises:
        ResultsError: If the folder cannot be written to.
    """
    try:
        _write_json(folder / RECORD_FILE, run_to_json(run))
        _write_json(folder / CARLA_FILE, carla_results(run))
    except OSError as error:
        raise ResultsError(f"cannot write results to {folder} ({error.strerror})") from error


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Writes beside the file, then renames: the file is the old or the new one, never half."""
    text = json.dumps(content, indent=1, allow_nan=False)
    with tempfile.NamedTemporaryFile(
        "w", encoding="utf-8", dir=path.parent, prefix=f".{path.name}.", delete=False
    ) as file:
        try:
            file.write(text + "\n")
            file.flush()
            os.fsync(file.fileno())
            os.chmod(file.name, 0o644)  # temporary files are private, results are not
            os.replace(file.name, path)
        except BaseException:
            os.unlink(file.name)
            raise


def read_run(path: Path) -> RunRecord:
    """Reads a run back from its folder or its `driveinsight.json`.

    Raises:
        ResultsError: If there is no such file, or it is half-written, foreign or of another
            format version.
    """
    path = path / RECORD_FILE if path.is_dir() else path
    if not path.exists():
        raise ResultsError(
            f"there is no {path}: give the folder that `driveinsight evaluate --output` wrote"
        )
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        raise ResultsError(f"{path} is not whole JSON ({error}): evaluate again") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ResultsError(
            f"{path} is not a {RECORD_FILE} of ours (its format is not '{FORMAT}'): "
            "give the folder that `driveinsight evaluate --output` wrote"
        )
    if content.get("format_version") != FORMAT_VERSION:
        raise ResultsError(
            f"{path} has format version {content.get('format_version')}, this program reads "
            f"{FORMAT_VERSION}: evaluate again"
        )
    try:
        return run_from_json(content)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ResultsError(
            f"{path} lacks or garbles a field ({error!r}): evaluate again"
        ) from error


def run_to_json(run: RunRecord) -> dict[str, Any]:
    """The run as JSON values."""
    fields = {field.name: getattr(run, field.name) for field in dataclasses.fields(run)}
    fields["seeds"] = list(run.seeds)
    fields["requires"] = dict(run.requires)
    fields["options"] = dict(run.options)
    fields["versions"] = dict(run.versions)
    fields["routes"] = [_route_to_json(record) for record in run.routes]
    return {"format": FORMAT, "format_version": FORMAT_VERSION, **fields}


def run_from_json(content: Mapping[str, Any]) -> RunRecord:
    """The inverse of `run_to_json`."""
    names = [field.name for field in dataclasses.fields(RunRecord)]
    values = {name: content[name] for name in names}
    values["seeds"] = tuple(values["seeds"])
    values["routes"] = tuple(_route_from_json(record) for record in values["routes"])
    return RunRecord(**values)


def _route_to_json(record: RouteRecord) -> dict[str, Any]:
    values = dataclasses.asdict(record)
    values["score"]["driving_score"] = record.score.driving_score
    values["events"] = [
        {**event, "kind": EventKind(event["kind"]).name.lower()} for event in values["events"]
    ]
    return values


def _route_from_json(content: Mapping[str, Any]) -> RouteRecord:
    score, bound = content["score"], content["bound"]
    events = tuple(
        EventRecord(**{**event, "kind": EventKind[event["kind"].upper()]})
        for event in content["events"]
    )
    kept = Score(
        route_completion=score["route_completion"], infraction_score=score["infraction_score"]
    )
    return RouteRecord(
        **{
            **content,
            "score": kept,
            "bound": None if bound is None else Bound(**bound),
            "events": events,
        }
    )
