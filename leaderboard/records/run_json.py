"""A run and its routes as JSON values and back, without loss; what cannot be one is refused."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from typing import Any

from di_envs.files.json_text import JsonError
from di_envs.files.json_values import from_json, to_json
from di_envs.files.plain_text import one_plain_line
from di_envs.rules import RULES
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.records.versions import INFORMATION

FORMAT = "driveinsight-run"
ROUTE_FORMAT = "driveinsight-route"
FORMAT_VERSION = 3
# Left out where empty, as in files from before there were any
_SINCE = ("interventions", "world", "isolated", "refused", "notes")


def run_hash(run: RunRecord) -> str:
    """What a run's routes call it by: a hash of all but the routes, and what is information only.

    So a run that goes on under another Python stays that run.
    """
    content = run_to_json(run)
    for name in INFORMATION:
        content["versions"].pop(name, None)
    text = json.dumps(content, sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def run_to_json(run: RunRecord) -> dict[str, Any]:
    """The run as JSON values, without its routes."""
    fields = to_json(dataclasses.replace(run, routes=()))
    del fields["routes"]
    for name in _SINCE:
        if not fields[name]:
            del fields[name]
    return {"format": FORMAT, "format_version": FORMAT_VERSION, **fields}


def run_from_json(content: Mapping[str, Any], source: str = "run") -> RunRecord:
    """The inverse of `run_to_json`: a run without routes.

    Args:
        content: JSON values, with or without the format and its version.
        source: What errors call the file.

    Raises:
        JsonError: If a field is missing, unknown or of another type.
    """
    empty = {"interventions": [], "world": {}, "isolated": False, "refused": {}, "notes": []}
    values: dict[str, Any] = {**empty, "routes": []}
    for name, value in content.items():
        if name == "routes":
            raise JsonError(f"{source}: unknown field 'routes'; each has a file of its own")
        if name not in ("format", "format_version"):
            values[name] = value
    run = from_json(RunRecord, values, source, complete=True)
    if run.rules not in RULES:
        raise JsonError(
            f"{source}: rules: expected one of {', '.join(RULES)}, got {one_plain_line(run.rules)}"
        )
    if not run.seeds or len(set(run.seeds)) < len(run.seeds):
        given = one_plain_line(str(run.seeds))
        raise JsonError(f"{source}: seeds: expected some, each once, got {given}")
    _check_requires(run.requires, source)
    return run


def _check_requires(requires: Mapping[str, Any], source: str) -> None:
    """Refuses what tables and replays could not read; what is new to this program, they say."""
    seen, options = requires.get("observations", ()), requires.get("options", {})
    if not (isinstance(seen, list | tuple) and all(isinstance(name, str) for name in seen)):
        given = one_plain_line(repr(seen))
        raise JsonError(f"{source}: requires.observations: expected a list of names, got {given}")
    if not isinstance(options, Mapping):
        given = one_plain_line(repr(options))
        raise JsonError(f"{source}: requires.options: expected options by name, got {given}")


def route_to_json(record: RouteRecord) -> dict[str, Any]:
    """The route as JSON values."""
    values: dict[str, Any] = to_json(record)
    if not record.weather:  # as in files from before it was kept
        del values["weather"]
    values["score"]["driving_score"] = record.score.driving_score
    return values


def route_from_json(content: Mapping[str, Any], source: str = "route") -> RouteRecord:
    """The inverse of `route_to_json`.

    Args:
        content: JSON values.
        source: What errors call the file.

    Raises:
        JsonError: If a field is missing, unknown or of another type, or if the driving score is not
            the product of the others.
    """
    values, given = {"weather": "", **content}, None
    if isinstance(score := values.get("score"), Mapping):
        values["score"] = {name: part for name, part in score.items() if name != "driving_score"}
        given = score.get("driving_score")
    record = from_json(RouteRecord, values, source, complete=True)
    product = record.score.driving_score
    if given != product or isinstance(given, bool):
        raise JsonError(
            f"{source}: score.driving_score: {given!r} is not the product of the others, {product}"
        )
    if not all(name.isdecimal() and len(name) < 4 for name in record.scenarios):
        names = one_plain_line(", ".join(record.scenarios))
        raise JsonError(f"{source}: scenarios: expected the numbers of types, got {names}")
    for name, unpacked in (
        ("controls", record.control_array),
        ("observation_checks", record.check_array),
    ):
        try:
            unpacked()
        except ValueError as error:
            raise JsonError(f"{source}: {name}: {error}") from error
    return record
