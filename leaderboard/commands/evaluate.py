"""`driveinsight evaluate`: drives an agent over routes and seeds, and prints the table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console

from leaderboard.commands.ending import EXIT_CRASHED, EXIT_INTERRUPTED, UsageError, say
from leaderboard.commands.scene_arguments import SceneArguments, says

if TYPE_CHECKING:
    from leaderboard.record import RunRecord

EVALUATE_HELP = """Drive an agent over routes and seeds, and print the leaderboard table.

Examples:
  driveinsight evaluate --agent expert --suite town05_short
  driveinsight evaluate --agent expert --suite town05_long --seeds 3 --workers 2
  driveinsight evaluate --agent path/to/mine.py:MyAgent --suite town05_tiny --route-ids 0 3
  driveinsight evaluate --agent expert --town Town05.xodr --signals town05 \\
      --routes routes_town05_long.xml --scenarios scenarios/
  driveinsight evaluate --agent expert --suite town05_long --scenarios none

Writes results.json (CARLA's schema) and driveinsight.json (everything) into --output."""


@dataclass(frozen=True, kw_only=True)
class Evaluate(SceneArguments):
    """The arguments of `driveinsight evaluate`."""

    seeds: Annotated[int, says("N", "1")] = 1
    """How many seeds to drive every route with: 3 means 0, 1 and 2."""

    workers: Annotated[int, says("N", "1")] = 1
    """Processes to drive in; the results are the same bits for any number."""

    route_ids: Annotated[tuple[str, ...], says("ID ...", "all")] = ()
    """Drive these routes only."""

    output: Annotated[Path | None, says("DIR", "a new one in results/")] = None
    """Folder for the result files."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace results that the folder holds already."""

    def run(self) -> int:
        """Evaluates; returns the exit code."""
        if self.seeds < 1 or self.workers < 1:
            raise UsageError("--seeds and --workers must be at least 1")
        options, suite = self.choose(self.route_ids)
        folder = self.output or _new_folder(f"{_plain(self.agent)}-{_plain(suite.name)}")

        from leaderboard.results import ResultsError, prepare_folder

        try:
            prepare_folder(folder, overwrite=self.overwrite)
        except ResultsError as error:
            raise UsageError(str(error)) from error

        from leaderboard.jobs import RunSpec
        from leaderboard.runner import evaluate
        from leaderboard.warm_up import SetupError

        spec = RunSpec(agent=self.agent, options=options, rules=self.rules)
        try:
            run = evaluate(
                spec, range(self.seeds), suite=suite, folder=folder, workers=self.workers
            )
        except (SetupError, ResultsError) as error:
            raise UsageError(str(error)) from error
        finally:
            _remove_if_empty(folder)
        _print_run(run, folder)
        if not run.complete:
            return EXIT_INTERRUPTED
        return EXIT_CRASHED if run.lost else 0


def _plain(name: str) -> str:
    """A name that can be part of a folder's: `path/to/mine.py:MyAgent` becomes `MyAgent`."""
    last = name.rpartition(":")[2]
    return "".join(c if c.isalnum() or c in "_-." else "_" for c in last)


def _new_folder(name: str) -> Path:
    """`results/NAME`, or `results/NAME-2` and so on where that is taken."""
    folder, number = Path("results") / name, 2
    while folder.exists():
        folder, number = Path("results") / f"{name}-{number}", number + 1
    return folder


def _remove_if_empty(folder: Path) -> None:
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def _print_run(run: RunRecord, folder: Path) -> None:
    from leaderboard.report import print_run
    from leaderboard.results import CARLA_FILE, RECORD_FILE

    print_run(run, Console())
    say(
        f"Written: {folder / CARLA_FILE} (CARLA's schema) and {folder / RECORD_FILE} (all of it).",
        f"Next: driveinsight show {folder}",
    )
