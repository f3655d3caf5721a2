"""`driveinsight compare`: pairs two runs by route and seed; says what changed, how surely, why."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from leaderboard.commands.ending import UsageError, say, typed
from leaderboard.commands.scene_arguments import says
from leaderboard.running.terminal import Terminal

COMPARE_HELP = """Pair two runs by route and seed: what changed in the second, how surely, and why.

Examples:
  driveinsight compare results/mine results/mine-2
  driveinsight compare results/expert-town05_long results/highway-town05_long --rules carla-2.1

Only runs of the same worlds are paired: same suite, town, traffic, package versions and CPU. Routes
that the machinery lost are left out."""


@dataclass(frozen=True, kw_only=True)
class Compare:
    """The arguments of `driveinsight compare`."""

    first: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FIRST")]
    """A run's output folder."""

    second: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SECOND")]
    """Another's."""

    rules: Annotated[str | None, says("NAME", "their own")] = None
    """Score both by these rules first."""

    def run(self) -> int:
        """Compares; returns the exit code."""
        from di_envs.rules import rules_named
        from leaderboard.records.rescoring import rescored
        from leaderboard.records.results import ResultsError, read_run
        from leaderboard.studies.comparing import PairingError, compare_runs
        from leaderboard.tables.comparison_table import comparison_tables

        try:
            runs = [read_run(path) for path in (self.first, self.second)]
            if self.rules is not None:
                runs = [rescored(run, rules_named(self.rules)) for run in runs]
            comparison = compare_runs(*runs)
        except (ResultsError, PairingError, ValueError) as error:
            raise UsageError(str(error)) from error
        Terminal().print(comparison_tables(comparison))
        say(f"Next: driveinsight verify {typed(self.second)}")
        return 0
