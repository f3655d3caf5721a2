"""What a study leaves in its folder: record, tables, figures; all drawn from the record."""

from __future__ import annotations

from pathlib import Path

from leaderboard.results import replace_file
from leaderboard.studies.ablation import Ablation, findings, work_out
from leaderboard.studies.ablation_picture import write_ablation_picture
from leaderboard.studies.ablation_table import ablation_markdown
from leaderboard.studies.record import Study
from leaderboard.studies.study_error import StudyError
from leaderboard.studies.study_file import write_study

TABLE_FILE, PICTURE_FILE = "study.md", "study.png"
ABLATION, PROMPT_EDITING = "ablation", "prompt editing"


def keep_ablation(folder: Path, study: Study) -> None:
    """Writes the record with what it says so far.

    Raises:
        StudyError: If it cannot be written.
    """
    write_study(folder, study, findings(work_out(study)))


def write_ablation(folder: Path, ablation: Ablation) -> list[Path]:
    """Writes table and figure.

    Returns:
        What was written.

    Raises:
        StudyError: If something cannot be.
    """
    picture, table = folder / PICTURE_FILE, folder / TABLE_FILE
    try:
        drawn = write_ablation_picture(picture, ablation)
        replace_file(table, ablation_markdown(ablation, PICTURE_FILE if drawn else ""))
    except OSError as error:
        raise StudyError(f"cannot write to {folder} ({error.strerror})") from error
    return [table, picture] if drawn else [table]
