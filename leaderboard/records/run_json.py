"""A run and its routes as JSON values and back, without loss; what cannot be one is refused."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from typing import Any, TypeVar

from di_envs.world.kinds import EventKind
from leaderboard.records.record import Bound, EventRecord, RouteRecord, RunRecord
from leaderboard.records.versions import INFORMATION
from leaderboard.scoring.score import Score

FORMAT = "driveinsight-run"
ROUTE_FORMAT = "driveinsight-route"
FORMAT_VERSION = 3

# Annotations that a JSON value can be held against
_TYPES: Mapping[str, tuple[type, ...]] = {"int": (int,), "float": (int, float), "str": (str,)}

_Record = TypeVar("_Record")


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
    fields = {field.name: getattr(run, field.name) for field in dataclasses.fields(run)}
    del fields["routes"]
    if run.interventions:  # left out where there are none, as in files from before there were any
        fields["interventions"] = list(run.interventions)
    else:
        del fields["interventions"]
    fields["seeds"] = list(run.seeds)
    fields["requires"] = dict(run.requires)
    fields["options"] = dict(run.options)
    fields["versions"] = dict(run.versions)
    return {"format": FORMAT, "format_version": FORMAT_VERSION, **fields}


def run_from_json(content: Mapping[str, Any]) -> RunRecord:
    """The inverse of `run_to_json`: a run without routes.

    Raises:
        KeyError: If a field is missing.
        TypeError: If one is of another type.
    """
    names = [field.name for field in dataclasses.fields(RunRecord) if field.name != "routes"]
    names.remove("interventions")
    values = {name: content[name] for name in names}
    values["interventions"] = tuple(content.get("interventions", ()))
    values["seeds"] = tuple(values["seeds"])
    return _checked(RunRecord, values)


def route_to_json(record: RouteRecord) -> dict[str, Any]:
    """The route as JSON values."""
    values = dataclasses.asdict(record)
    values["score"]["driving_score"] = record.score.driving_score
    values["events"] = [
        {**event, "kind": EventKind(event["kind"]).name.lower()} for event in values["events"]
    ]
    return values


def route_from_json(content: Mapping[str, Any]) -> RouteRecord:
    """The inverse of `route_to_json`.

    Raises:
        KeyError: If a field is missing.
        TypeError: If one is of another type.
        ValueError: If the driving score is not the product of the others.
    """
    values = {field.name: content[field.name] for field in dataclasses.fields(RouteRecord)}
    score, bound = dict(values["score"]), values["bound"]
    driving_score = score.pop("driving_score")
    values["score"] = kept = _checked(Score, score)
    if driving_score != kept.driving_score:
        raise ValueError(f"driving_score {driving_score} is not the product of the others")
    if bound is not None:
        values["bound"] = _checked(Bound, bound)
    values["events"] = tuple(
        _checked(EventRecord, {**event, "kind": EventKind[event["kind"].upper()]})
        for event in values["events"]
    )
    values["interventions"] = tuple(values["interventions"])
    values["trace"] = tuple(tuple(row) for row in values["trace"])
    return _checked(RouteRecord, values)


def _checked(record: type[_Record], values: Mapping[str, Any]) -> _Record:
    """The record of these values, its numbers and texts being such."""
    for field in dataclasses.fields(record):  # type: ignore[arg-type]
        expected = _TYPES.get(str(field.type))
        value = values.get(field.name, field.default)
        if expected and (not isinstance(value, expected) or isinstance(value, bool)):
            raise TypeError(f"{field.name} must be of type {field.type}, not {value!r}")
    return record(**values)
