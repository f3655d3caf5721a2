"""Responses of drives on disk: one `.npz` a drive, which NumPy alone can read.

RUN/responses/route-3-seed-0.npz     arrays by their names; `about` is JSON: the rest
"""

from __future__ import annotations

import dataclasses
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from di_envs.files.json_values import parsed
from di_envs.files.plain_text import file_name
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
        with np.load(path, allow_pickle=False) as file:
            about: dict[str, Any] = parsed(str(file["about"]), "about")
            arrays = {name: file[name] for name in _ARRAYS}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ResponseFileError(
            f"{path} holds no responses ({error}): run driveinsight respond again"
        ) from error
    found = (about.pop("format", None), about.pop("format_version", None))
    if found != (FORMAT, FORMAT_VERSION):
        raise ResponseFileError(
            f"{path} is of format {found}, this program reads {(FORMAT, FORMAT_VERSION)}: run "
            "driveinsight respond again"
        )
    for name in ("groups", "situations"):
        about[name] = tuple(about[name])
    about["events"] = tuple((float(time_s), str(name)) for time_s, name in about["events"])
    return DriveResponses(**about, **arrays)
