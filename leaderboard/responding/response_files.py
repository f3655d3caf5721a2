"""Responses of drives on disk: one `.npz` a drive, which NumPy alone can read.

RUN/responses/route-3-seed-0.npz     arrays by their names; `about` is JSON: the rest
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.files.json_text import parsed
from di_envs.files.json_values import from_json
from di_envs.files.plain_text import file_name
from di_envs.files.received import check_array, read_arrays
from di_envs.files.whole import write_whole
from leaderboard.responding.drive_responses import DriveResponses

FORMAT = "driveinsight-responses"
FORMAT_VERSION = 1
_ARRAYS = ("time_s", "speed_mps", "gradient", "attention", "waypoints", "holds")


class ResponseFileError(Exception):
    """A file that holds no responses that can be read; the message says what to do."""


def responses_file(folder: Path, route_id: str, seed: int) -> Path:
    """Where the responses of a route and seed are kept."""
    return folder / f"route-{file_name(route_id)}-seed-{seed}.npz"


def write_responses(path: Path, drive: DriveResponses) -> None:
    """Writes a drive's responses; the folder is made. The file is whole or not there.

    Raises:
        OSError: If it cannot be written.
    """
    fields = {field.name: getattr(drive, field.name) for field in dataclasses.fields(drive)}
    arrays = {name: fields.pop(name) for name in _ARRAYS}
    about = json.dumps({"format": FORMAT, "format_version": FORMAT_VERSION, **fields})
    write_whole(path, lambda file: np.savez_compressed(file, about=np.array(about), **arrays))


def read_responses(path: Path) -> DriveResponses:
    """The responses of a drive.

    Raises:
        ResponseFileError: If there are none that this program reads.
    """
    try:
        content = read_arrays(path)
        about = from_json(dict[str, Any], parsed(str(content["about"]), "about"), "about")
        arrays = {name: content[name] for name in _ARRAYS}
    except (ValueError, KeyError) as error:
        raise ResponseFileError(
            f"{path} holds no responses ({error}): run driveinsight respond again"
        ) from error
    found = (about.pop("format", None), about.pop("format_version", None))
    if found != (FORMAT, FORMAT_VERSION):
        raise ResponseFileError(
            f"{path} is of format {found}, this program reads {(FORMAT, FORMAT_VERSION)}: run "
            "driveinsight respond again"
        )
    try:
        told: dict[str, Any] = vars(from_json(_About, about, "about", complete=True))
        _check(arrays, len(told["groups"]), len(told["situations"]))
    except ValueError as error:
        raise ResponseFileError(
            f"{path} is damaged ({error}): run driveinsight respond again"
        ) from error
    return DriveResponses(**{**told, **arrays})


@dataclass(frozen=True, kw_only=True)
class _About:
    """What a file holds beside arrays."""

    route_id: str
    seed: int
    agent: str
    drive: str
    route_hash: str
    every_s: float
    events: tuple[tuple[float, str], ...]
    groups: tuple[str, ...]
    situations: tuple[str, ...]


def _check(arrays: Mapping[str, NDArray[Any]], groups: int, situations: int) -> None:
    """Refuses arrays of other shapes than their names say; see `DriveResponses`."""
    moments = len(check_array(arrays, "time_s", "f", (None,), finite=True))
    check_array(arrays, "speed_mps", "f", (moments,))
    check_array(arrays, "gradient", "f", (moments, groups, 2))
    check_array(arrays, "attention", "f", (moments, None, None, groups))
    check_array(arrays, "waypoints", "f", (moments, None, 2))
    check_array(arrays, "holds", "b", (moments, situations))
