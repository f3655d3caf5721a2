"""`study.json`: a study's record on disk, written whole and checked when it is read."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from leaderboard.records.results import replace_file
from leaderboard.studies import StudyError
from leaderboard.studies.record import DrivenRow, Study, StudyDrive
from leaderboard.studies.rows import Row

STUDY_FILE = "study.json"
FORMAT, FORMAT_VERSION = "driveinsight-study", 2
_DRIVE = tuple(part.name for part in dataclasses.fields(StudyDrive))


def write_study(folder: Path, study: Study, findings: Mapping[str, Any] | None = None) -> None:
    """Writes the record; the file is the old or the new one, never half.

    Args:
        folder: Of the study.
        study: The study.
        findings: What is worked out from it, for those who read the file without this program; it
            is not read back.

    Raises:
        StudyError: If it cannot be written.
    """
    head = {
        part.name: getattr(study, part.name)
        for part in dataclasses.fields(Study)
        if part.name not in ("rows", "extra")
    }
    lines = [f" {json.dumps(name)}: {_compact(value)}" for name, value in head.items()]
    lines.insert(0, f' "format": "{FORMAT}",\n "format_version": {FORMAT_VERSION}')
    lines.append(f' "drive_columns": {_compact(_DRIVE)}')
    rows = ",\n".join(f"  {_compact(_row_to_json(driven))}" for driven in study.rows)
    lines.append(f' "rows": [\n{rows}\n ]')
    lines.append(f' "extra": {_compact(study.extra)}')
    lines.append(f' "findings": {_compact(findings or {})}')
    try:
        folder.mkdir(parents=True, exist_ok=True)
        replace_file(folder / STUDY_FILE, "{\n" + ",\n".join(lines) + "\n}\n")
    except OSError as error:
        raise StudyError(f"cannot write {folder / STUDY_FILE} ({error.strerror})") from error


def read_study(path: Path) -> Study:
    """Reads the record of a study.

    Args:
        path: Its folder, or `study.json` in it.

    Raises:
        StudyError: If there is none, or it is broken, foreign or of another format.
    """
    path = path if path.name == STUDY_FILE else path / STUDY_FILE
    if not path.is_file():
        raise StudyError(
            f"there is no {path}: give the folder that `driveinsight ablate` or "
            "`driveinsight edit` wrote"
        )
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        raise StudyError(
            f"{path} is not whole JSON ({error}): remove it and repeat the command that made it; "
            "what was driven is in rows/ and is not driven again"
        ) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise StudyError(f"{path} is no record of a study (its format is not '{FORMAT}')")
    if content.get("format_version") != FORMAT_VERSION:
        raise StudyError(
            f"{path} has format version {content.get('format_version')}, this program reads "
            f"{FORMAT_VERSION}: read it with the version that wrote it, or drive the study again"
        )
    try:
        return _study_from_json(content)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise StudyError(
            f"{path} lacks or garbles a field ({error!r}): remove it and repeat the command that "
            "made it; what was driven is in rows/ and is not driven again"
        ) from error


def _study_from_json(content: Mapping[str, Any]) -> Study:
    values = {part.name: content[part.name] for part in dataclasses.fields(Study)}
    for name in ("interventions", "seeds"):
        values[name] = tuple(values[name])
    columns = tuple(content["drive_columns"])
    if set(columns) != set(_DRIVE):
        raise ValueError(f"drives have the columns {', '.join(columns)}")
    values["rows"] = tuple(_row_from_json(row, columns) for row in values["rows"])
    study = Study(**values)
    study.baseline  # noqa: B018 - every study has one: raises otherwise
    return study


def _row_to_json(driven: DrivenRow) -> dict[str, Any]:
    values = dataclasses.asdict(driven.row)
    values |= {"planned": driven.planned, "left_out": driven.left_out}
    values["wall_s"] = driven.wall_s
    values["drives"] = [[getattr(drive, name) for name in _DRIVE] for drive in driven.drives]
    return values


def _row_from_json(content: Mapping[str, Any], columns: tuple[str, ...]) -> DrivenRow:
    row = Row(**{part.name: content[part.name] for part in dataclasses.fields(Row)})
    drives = []
    for numbers in content["drives"]:
        drive = StudyDrive(**dict(zip(columns, numbers, strict=True)))
        for name in ("driving_score", "route_completion", "infraction_score", "wall_s", "done_m"):
            if not isinstance(getattr(drive, name), int | float):
                raise TypeError(f"{name} of a drive is no number: {getattr(drive, name)!r}")
        drives.append(drive)
    return DrivenRow(
        row=row,
        planned=content["planned"],
        drives=tuple(drives),
        left_out=content["left_out"],
    )


def _compact(value: Any) -> str:
    return json.dumps(value, allow_nan=False, separators=(",", ":"))
