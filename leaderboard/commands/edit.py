"""`driveinsight edit`: the prompt-editing experiments of the paper, each with a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from leaderboard.commands.ending import say, typed
from leaderboard.commands.scene_arguments import says
from leaderboard.commands.study_arguments import StudyArguments, run_study
from leaderboard.running.terminal import Terminal

if TYPE_CHECKING:
    from leaderboard.studies.record import Study
    from leaderboard.studies.rows import Row

EDIT_HELP = """Edit what a policy is told, as the paper does: do its findings hold for this one?

Examples:
  driveinsight edit --agent driveinsight --suite town05_short --workers 2
  driveinsight edit --agent driveinsight --suite town05_short --experiments route lights
  driveinsight edit --agent driveinsight --suite town05_short --experiments speed
  driveinsight edit --agent mine.py:MyAgent --suite town05_tiny --route-ids 0 3 97
  driveinsight edit --show results/prompt-editing-driveinsight-town05_short

Experiments:
  route   routing and target point moved sideways: how far does the ego go along?
  speed   the given speed set from 0 to 15 m/s: how far does it plan? (no driving)
  map     noise and masks on the map: more drives off road or blocked?
  lights  lights recoloured: does it brake for green, drive over red?
  bev     BEV features masked: more collisions, red lights, wrong lanes, blocked drives?

Each edit is a run of its own in STUDY/rows, over the same worlds as the baseline. Each experiment
has a figure, and a sentence that says whether the paper's finding holds, with the numbers;
docs/studies.md says how each is measured. The same command goes on where it was stopped."""


@dataclass(frozen=True, kw_only=True)
class Edit(StudyArguments):
    """The arguments of `driveinsight edit`."""

    experiments: Annotated[tuple[str, ...], says("NAME ...", "all")] = ()
    """Some of: route, speed, map, lights, bev."""

    def run(self) -> int:
        """Drives the experiments, or shows them; returns the exit code."""
        return run_study(self, _WhatHolds(names=self.experiments, workers=self.workers))


@dataclass(frozen=True, kw_only=True)
class _WhatHolds:
    """Which of the paper's findings hold, by experiments."""

    names: tuple[str, ...]
    workers: int
    kind: str = "prompt editing"

    def rows(self) -> Sequence[Row]:
        from leaderboard.studies.experiments import choose_experiments

        return [row for experiment in choose_experiments(self.names) for row in experiment.rows]

    def measured(self, study: Study, folder: Path) -> Study:
        from leaderboard.studies.experiments import choose_experiments
        from leaderboard.studies.prompt_editing import judged

        return judged(
            folder,
            study,
            choose_experiments(self.names),
            workers=self.workers,
            console=Terminal(stderr=True),
        )

    def print_study(self, study: Study, folder: Path) -> list[str]:
        from leaderboard.pages.study_files import write_prompt_editing
        from leaderboard.studies.study_file import STUDY_FILE
        from leaderboard.tables.prompt_editing_table import prompt_editing_tables

        written = write_prompt_editing(folder, study)
        Terminal().print(prompt_editing_tables(study))
        say(f"Written: {', '.join(str(path) for path in [folder / STUDY_FILE, *written])}")
        baseline = typed(folder / "rows" / "baseline")
        return [
            f"Next: driveinsight report {baseline}       a page with its drives",
            f"      driveinsight explain {baseline} --route ID       why it drove one so",
            f"      driveinsight verify {baseline}       does the claim stand?",
        ]
