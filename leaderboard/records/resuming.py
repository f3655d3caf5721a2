"""Continues a run that was cut short: only the same run, on the same footing.

A record is a function of (agent, options, route, seed) for given versions and CPU, so routes of an
earlier process stand beside new ones exactly if all of these are equal.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Iterator
from pathlib import Path

from leaderboard.records.footing import record_differences
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.records.results import (
    RECORD_FILE,
    DamagedError,
    ResultsError,
    read_head,
    read_route,
    route_files,
)

# Of a run all is asked for or found out before it drives, but for the routes that it has driven
_ASKED = tuple(part.name for part in dataclasses.fields(RunRecord) if part.name != "routes")


def resumed(folder: Path, run: RunRecord) -> RunRecord:
    """The run with what the folder holds of it.

    Args:
        folder: Where an earlier process may have written routes of this run.
        run: The run as it would start now, with no routes.

    Raises:
        ResultsError: If the folder holds another run, or one driven on another footing; the
            message says what differs.
    """
    found = record_differences(_earlier(folder) or run, run, _ASKED)
    if found:
        said = "; ".join(difference.was_is for difference in found)
        raise ResultsError(
            f"{folder} cannot be resumed, its results would mix: {said}. Repeat the command as it "
            "was, or choose another --output"
        )
    return dataclasses.replace(run, routes=tuple(_kept(folder, run)))


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
