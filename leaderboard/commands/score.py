"""`driveinsight score`: scores a finished run by other rules, without driving."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from leaderboard.commands.ending import UsageError, say, typed
from leaderboard.commands.scene_arguments import says
from leaderboard.running.terminal import Terminal

SCORE_HELP = """Score a finished run by other rules, without driving, beside its own.

Examples:
  driveinsight score results/expert-town05_long --rules di-1.0
  driveinsight score results/mine --rules carla-2.0 --output results/mine-2.0

What was detected stays; docs/rules.md says what each rule set makes of it."""


@dataclass(frozen=True, kw_only=True)
class ScoreByRules:
    """The arguments of `driveinsight score`."""

    path: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run's output folder, or results.json or driveinsight.json in it."""

    rules: Annotated[str, tyro.conf.arg(metavar="NAME")]
    """di-1.0, carla-1.0, carla-2.0 or carla-2.1."""

    output: Annotated[Path | None, says("DIR", "write nothing")] = None
    """Folder for the run as those rules score it."""

    def run(self) -> int:
        """Scores; returns the exit code."""
        from di_envs.rules import rules_named
        from leaderboard.records.own_files import prepare_folder
        from leaderboard.records.rescoring import rescored
        from leaderboard.records.results import ResultsError, read_run, write_run
        from leaderboard.tables.rescoring_table import rescoring_table

        try:
            run = read_run(self.path)
            other = rescored(run, rules_named(self.rules))
            if not run.scored:
                raise UsageError(f"{self.path} holds no route that was driven: nothing to score")
            if self.output is not None:
                prepare_folder(self.output)
                write_run(self.output, other)
        except (ResultsError, ValueError) as error:
            raise UsageError(str(error)) from error
        Terminal().print(rescoring_table(run, other))
        if self.output is None:
            say("Nothing was written: pass --output DIR to keep the run under these rules.")
        else:
            say(f"Written: {self.output}", f"Next: driveinsight show {typed(self.output)}")
        return 0
