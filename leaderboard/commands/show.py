"""`driveinsight show`: prints the table of a run again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from leaderboard.commands.ending import UsageError
from leaderboard.running.terminal import Terminal

SHOW_HELP = """Print the table of a run that was evaluated before.

Example:
  driveinsight show results/expert-town05_long"""


@dataclass(frozen=True, kw_only=True)
class Show:
    """The arguments of `driveinsight show`."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")]
    """The run's output folder."""

    def run(self) -> int:
        """Prints the table; returns the exit code."""
        from leaderboard.records.results import ResultsError, read_run
        from leaderboard.tables.run_tables import print_run

        try:
            run = read_run(self.folder)
        except ResultsError as error:
            raise UsageError(str(error)) from error
        print_run(run, Terminal())
        return 0
