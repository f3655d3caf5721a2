"""The prompt-editing experiments for the terminal: the paper's findings, what was found, scores."""

from __future__ import annotations

from rich.console import Group
from rich.text import Text

from leaderboard.studies.ablation import work_out
from leaderboard.studies.experiments import EXPERIMENTS
from leaderboard.studies.prompt_editing import MISSING, finding_sentence, judgements_of
from leaderboard.studies.record import Study
from leaderboard.tables.ablation_table import ablation_tables


def prompt_editing_tables(study: Study) -> Group:
    """What was found, then the rows' scores."""
    lines = []
    for judgement in judgements_of(study):
        experiment = EXPERIMENTS[judgement.experiment]
        lines += [
            Text(experiment.title, style="bold"),
            Text(f"The paper: {experiment.claim}.", style="dim"),
            Text(f"{finding_sentence(judgement)}\n"),
        ]
    lines += [Text(line) for line in missing_lines(study)]
    return Group(*lines, ablation_tables(work_out(study)))


def missing_lines(study: Study) -> list[str]:
    """Experiments of which nothing can be said, and why."""
    found = study.extra.get(MISSING, {})
    return [f"Nothing on {EXPERIMENTS[name].title}: {why}" for name, why in found.items()]
