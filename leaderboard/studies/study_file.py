"""`study.json`: a study's record on disk, written whole and checked when it is read."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from di_envs.files.json_text import ForeignError, JsonError, by_lines, compact, read_document
from di_envs.files.json_values import from_json, to_json
from di_envs.files.plain_text import file_name, one_plain_line
from di_envs.files.whole import write_whole
from leaderboard.studies import StudyError
from leaderboard.studies.record import DrivenRow, Study, StudyDrive
from leaderboard.studies.rows import BASELINE, NULL, Row

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
    rows = ",\n".join(f"  {compact(_row_to_json(driven))}" for driven in study.rows)
    lines = {"format": compact(FORMAT), "format_version": compact(FORMAT_VERSION)}
    lines |= {name: compact(value) for name, value in head.items()}
    lines |= {"drive_columns": compact(_DRIVE), "rows": f"[\n{rows}\n ]"}
    lines |= {"extra": compact(study.extra), "findings": compact(findings or {})}
    try:
        write_whole(folder / STUDY_FILE, by_lines(lines))
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
        return _study_from_json(read_document(path, FORMAT, FORMAT_VERSION), str(path))
    except ForeignError as error:
        raise StudyError(
            f"{error}: give the folder of a study, read it with the version that wrote it, or "
            "drive the study again"
        ) from error
    except JsonError as error:
        raise StudyError(
            f"{error}: remove it and repeat the command that made it; what was driven is in rows/ "
            "and is not driven again"
        ) from error


def _study_from_json(content: dict[str, Any], source: str) -> Study:
    content.pop("findings", None)
    content.setdefault("isolated", False)  # in studies from before it was kept
    columns = from_json(
        tuple[str, ...], content.pop("drive_columns", None), source, "drive_columns"
    )
    if set(columns) != set(_DRIVE):
        raise JsonError(
            f"{source}: drive_columns: expected {', '.join(_DRIVE)}, got "
            f"{one_plain_line(', '.join(columns))}"
        )
    rows = from_json(tuple[_Row, ...], content.pop("rows", None), source, "rows", complete=True)
    study = from_json(Study, {**content, "rows": []}, source, complete=True)
    driven = tuple(
        row.driven(columns, source, f"rows[{number}]") for number, row in enumerate(rows)
    )
    for name in (BASELINE, NULL):
        if not any(row.row.name == name for row in driven):
            raise JsonError(f"{source}: rows: none is named '{name}'; every study has one")
    return dataclasses.replace(study, rows=driven)


@dataclass(frozen=True, kw_only=True)
class _Row:
    """A row as the file spells it: its drives are lists, in the order of `drive_columns`."""

    name: str
    edit: str
    component: str
    group: str
    planned: int
    left_out: str
    wall_s: float  # of all drives together: for readers without this program
    drives: tuple[tuple[Any, ...], ...]

    def driven(self, columns: tuple[str, ...], source: str, at: str) -> DrivenRow:
        """The row and its drives."""
        if file_name(self.name) != self.name:
            raise JsonError(
                f"{source}: {at}.name: expected a name that a folder can have, got {self.name!r}"
            )
        for number, values in enumerate(self.drives):
            if len(values) != len(columns):
                raise JsonError(
                    f"{source}: {at}.drives[{number}]: expected {len(columns)} values, "
                    f"got {len(values)}"
                )
        named = [dict(zip(columns, values, strict=True)) for values in self.drives]
        drives = from_json(tuple[StudyDrive, ...], named, source, f"{at}.drives", complete=True)
        row = Row(name=self.name, edit=self.edit, component=self.component, group=self.group)
        return DrivenRow(row=row, planned=self.planned, drives=drives, left_out=self.left_out)


def _row_to_json(driven: DrivenRow) -> dict[str, Any]:
    values: dict[str, Any] = to_json(driven.row)
    values |= {"planned": driven.planned, "left_out": driven.left_out}
    values["wall_s"] = driven.wall_s
    values["drives"] = [[getattr(drive, name) for name in _DRIVE] for drive in driven.drives]
    return values
