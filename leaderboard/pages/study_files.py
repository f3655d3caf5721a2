"""What a study leaves in its folder: record, tables, figures; all drawn from the record."""

from __future__ import annotations

from pathlib import Path

from di_envs.files.shown_text import in_markdown
from di_envs.files.whole import write_whole
from leaderboard.pages.ablation_picture import write_ablation_picture
from leaderboard.pages.prompt_pictures import write_prompt_picture
from leaderboard.studies import StudyError
from leaderboard.studies.ablation import Ablation, work_out
from leaderboard.studies.ablation_findings import findings
from leaderboard.studies.experiments import EXPERIMENTS
from leaderboard.studies.prompt_editing import (
    finding_sentence,
    judgements_of,
    prompt_findings,
)
from leaderboard.studies.record import Study
from leaderboard.studies.study_file import write_study
from leaderboard.tables.ablation_cells import title
from leaderboard.tables.ablation_table import ablation_markdown, table_lines
from leaderboard.tables.prompt_editing_table import missing_lines

TABLE_FILE, PICTURE_FILE = "study.md", "study.png"


def keep_study(folder: Path, study: Study) -> None:
    """Writes the record with what it says so far.

    Raises:
        StudyError: If it cannot be written.
    """
    found = {**findings(work_out(study)), "prompt_editing": prompt_findings(study)}
    write_study(folder, study, found)


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
        write_whole(table, ablation_markdown(ablation, PICTURE_FILE if drawn else ""))
    except OSError as error:
        raise StudyError(f"cannot write to {folder} ({error.strerror})") from error
    return [table, picture] if drawn else [table]


def write_prompt_editing(folder: Path, study: Study) -> list[Path]:
    """Writes the table and a figure for each experiment.

    Returns:
        What was written.

    Raises:
        StudyError: If something cannot be.
    """
    ablation = work_out(study)
    lines, written = [f"# {in_markdown(title(ablation))}", ""], []
    try:
        for judgement in judgements_of(study):
            picture = folder / f"{judgement.experiment}.png"
            experiment = EXPERIMENTS[judgement.experiment]
            lines += [f"## {experiment.title[0].upper()}{experiment.title[1:]}", ""]
            lines += [f"The paper: {experiment.claim}.", ""]
            lines += [in_markdown(finding_sentence(judgement)), ""]
            if write_prompt_picture(picture, judgement):
                written.append(picture)
                lines += [f"![{experiment.title}]({picture.name})", ""]
        lines += [f"- {in_markdown(line)}" for line in missing_lines(study)]
        lines += ["", *table_lines(ablation)]
        write_whole(folder / TABLE_FILE, "\n".join(lines))
    except OSError as error:
        raise StudyError(f"cannot write to {folder} ({error.strerror})") from error
    return [folder / TABLE_FILE, *written]
