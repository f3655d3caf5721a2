"""Continues a run that was cut short: only the same run, on the same footing.

A record is a function of (agent, options, route, seed) for given versions and CPU, so routes of an
earlier process stand beside new ones exactly if all of these are equal.
"""

from __future__ import annotations

import dataclasses
import json
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.records.results import (
    RECORD_FILE,
    DamagedError,
    ResultsError,
    read_head,
    read_route,
    route_files,
)
from leaderboard.records.run_json import run_from_json, run_to_json

_NAMES = {
    "agent_hash": "the hash of the agent's code",
    "cpu": "the CPU's capability",
    "planned": "the number of routes x seeds",
    "requires": "what the agent requires",
    "routes_hash": "the hash of the routes",
    "town_hash": "the hash of the town's map",
}


def resumed(folder: Path, run: RunRecord) -> RunRecord:
    """The run with what the folder holds of it.

    Args:
        folder: Where an earlier process may have written routes of this run.
        run: The run as it would start now, with no routes.

    Raises:
        ResultsError: If the folder holds another run, or one driven on another footing; the
            message says what differs.
    """
    written = run_from_json(json.loads(json.dumps(run_to_json(run))))  # as its file would read
    differences = list(_differences(_earlier(folder) or written, written))
    if differences:
        raise ResultsError(
            f"{folder} cannot be resumed, its results would mix: {'; '.join(differences)}. Repeat "
            "the command as it was, or choose another --output"
        )
    return dataclasses.replace(run, routes=tuple(_kept(folder, written)))


def _earlier(folder: Path) -> RunRecord | None:
    """What was asked for before; None if that cannot be read. Each route names its run, too."""
    if not (folder / RECORD_FILE).exists():
        return None
    try:
        return read_head(folder)
    except DamagedError:
        warnings.warn(f"{folder / RECORD_FILE} is damaged: it is written anew", stacklevel=2)
        return None


def _kept(folder: Path, run: RunRecord) -> Iterator[RouteRecord]:
    """The routes that need not be driven again: not those that were lost or are damaged."""
    for file in route_files(folder):
        try:
            record = read_route(file, run)
        except DamagedError:
            warnings.warn(f"{file} is damaged: that route is driven again", stacklevel=2)
            continue
        if not record.lost:
            yield record


def _differences(earlier: RunRecord, now: RunRecord) -> Iterator[str]:
    """What is not as it was, each as `seeds was 0, 1, is 0`."""
    for field in dataclasses.fields(RunRecord):
        if field.name == "routes":
            continue
        old, new = getattr(earlier, field.name), getattr(now, field.name)
        if isinstance(old, dict) and isinstance(new, dict):
            for key in sorted(old.keys() | new.keys()):
                if old.get(key) != new.get(key):
                    yield _was(f"{field.name} '{key}'", old.get(key), new.get(key))
        elif old != new:
            yield _was(_NAMES.get(field.name, field.name), old, new)


def _was(name: str, old: Any, new: Any) -> str:
    return f"{name} was {_text(old)}, is {_text(new)}"


def _text(value: Any) -> str:
    if value is None:
        return "not given"
    return ", ".join(map(str, value)) or "none" if isinstance(value, tuple | list) else str(value)
