"""`driveinsight ablate`: takes away one component after the other, and says which ones matter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from leaderboard.commands.ending import say, typed
from leaderboard.commands.scene_arguments import says
from leaderboard.commands.study_arguments import StudyArguments, run_study
from leaderboard.running.terminal import Terminal

if TYPE_CHECKING:
    from leaderboard.studies.record import Study
    from leaderboard.studies.rows import Row

ABLATE_HELP = """Take away one component of what an agent knows after the other: which ones matter?

Examples:
  driveinsight ablate --agent driveinsight --suite town05_short
  driveinsight ablate --agent driveinsight --suite town05_short --seeds 3 --workers 2
  driveinsight ablate --agent driveinsight --suite town05_short --rows routing drop-map
  driveinsight ablate --agent mine.py:MyAgent --suite town05_tiny --only zero --route-ids 0 3 97
  driveinsight ablate --show results/ablation-driveinsight-town05_short

Each row is a run of its own in STUDY/rows, over the same worlds as the baseline: `drop` says that a
component is not given, `zero` gives zeros for its values. The table has each row's difference to
the baseline with an interval, a verdict, and the paper's Table 2 beside it; docs/studies.md says
what they mean. The same command goes on where it was stopped, and with more --seeds or --rows it
adds to what is there."""


@dataclass(frozen=True, kw_only=True)
class Ablate(StudyArguments):
    """The arguments of `driveinsight ablate`."""

    rows: Annotated[tuple[str, ...], says("ROW ...", "all")] = ()
    """Such as drop-routing or zero:map; `routing` is both ways of it."""

    only: Annotated[Literal["drop", "zero"] | None, says("drop|zero", "both")] = None
    """One way of taking away only."""

    def run(self) -> int:
        """Drives the ablation, or shows one; returns the exit code."""
        return run_study(self, _WhatMatters(names=self.rows, only=self.only))


@dataclass(frozen=True, kw_only=True)
class _WhatMatters:
    """Which components matter, each taken away in turn."""

    names: tuple[str, ...]
    only: str | None
    kind: str = "ablation"

    def rows(self) -> Sequence[Row]:
        from leaderboard.studies.rows import choose_rows

        return choose_rows(self.names, self.only)

    def measured(self, study: Study, folder: Path) -> Study:
        return study  # its drives say it all

    def print_study(self, study: Study, folder: Path) -> list[str]:
        from leaderboard.pages.study_files import write_ablation
        from leaderboard.studies.ablation import work_out
        from leaderboard.studies.study_file import STUDY_FILE
        from leaderboard.tables.ablation_table import ablation_tables

        ablation = work_out(study)
        written = write_ablation(folder, ablation)
        Terminal().print(ablation_tables(ablation))
        say(f"Written: {', '.join(str(path) for path in [folder / STUDY_FILE, *written])}")
        worst = min(ablation.rows, key=lambda row: row.difference.mean, default=None)
        if worst is None:
            return []
        rows = folder / "rows"
        named = typed(rows / worst.driven.row.name)
        return [
            f"Next: driveinsight compare {typed(rows / 'baseline')} {named}",
            f"      driveinsight report {named}       a page with its drives",
            f"      driveinsight explain {named} --route ID       why it drove one so",
            f"      driveinsight verify {named}       does the claim stand?",
        ]
