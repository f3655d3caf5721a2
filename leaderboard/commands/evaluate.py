"""`driveinsight evaluate`: drives an agent over routes and seeds, and prints the table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from leaderboard.commands.ending import EXIT_CRASHED, EXIT_INTERRUPTED, UsageError, say, typed
from leaderboard.commands.engine_arguments import EngineArguments
from leaderboard.commands.scene_arguments import SceneArguments, says
from leaderboard.running.terminal import Terminal

if TYPE_CHECKING:
    from leaderboard.records.record import RunRecord
    from leaderboard.running.runner import Existing

EVALUATE_HELP = """Drive an agent over routes and seeds, and print the leaderboard table.

Examples:
  driveinsight evaluate --agent expert --suite town05_short
  driveinsight evaluate --agent expert --suite town05_long --seeds 3 --workers 2
  driveinsight evaluate --agent expert --suite town05_long --seeds 3 --workers 2 --resume
  driveinsight evaluate --agent path/to/mine.py:MyAgent --suite town05_tiny --route-ids 0 3
  driveinsight evaluate --agent expert --town Town05.xodr --signals town05 \\
      --routes routes_town05_long.xml --scenarios scenarios/
  driveinsight evaluate --agent expert --suite town05_long --scenarios none
  driveinsight evaluate --agent path/to/mine.py:MyAgent --suite town05_tiny \\
      --intervene "drop:routing; set:speed=0@t>5"

Writes results.json (CARLA's schema) and driveinsight.json with routes/ (everything) into --output,
each route as it is finished: after Ctrl-C or a crash, the same command with --resume continues."""


@dataclass(frozen=True, kw_only=True)
class Evaluate(EngineArguments, SceneArguments):
    """The arguments of `driveinsight evaluate`."""

    seeds: Annotated[int, says("N", "1")] = 1
    """How many seeds to drive every route with: 3 means 0, 1 and 2."""

    route_ids: Annotated[tuple[str, ...], says("ID ...", "all")] = ()
    """Drive these routes only."""

    output: Annotated[Path | None, says("DIR", "a new one in results/")] = None
    """Folder for the result files."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace results that the folder holds already."""

    resume: tyro.conf.FlagCreatePairsOff[bool] = False
    """Continue the run that the folder holds; start it if there is none."""

    def run(self) -> int:
        """Evaluates; returns the exit code."""
        if self.seeds < 1:
            raise UsageError("--seeds must be at least 1")
        self.check_engine()
        if self.overwrite and self.resume:
            raise UsageError("--overwrite and --resume exclude each other: choose one")
        options, suite = self.choose(self.route_ids)
        folder = self.output or default_folder(self.agent, suite.name, last=self.resume)

        from leaderboard.records.results import ResultsError
        from leaderboard.running.interruption import interruptible
        from leaderboard.running.jobs import RunSpec, SetupError
        from leaderboard.running.runner import evaluate

        spec = RunSpec(
            agent=self.agent,
            options=options,
            rules=self.rules,
            interventions=self.edits(),
            isolate=not self.no_isolate,
        )
        new = not folder.exists()
        try:
            with interruptible(ends_process=True):
                run = evaluate(
                    spec,
                    range(self.seeds),
                    suite=suite,
                    folder=folder,
                    engine=self.make_engine(),
                    existing=self._existing(),
                )
        except (SetupError, ResultsError) as error:
            raise UsageError(str(error)) from error
        finally:
            if new:
                remove_if_empty(folder)
        _print_run(run, folder)
        if not run.complete:
            return EXIT_INTERRUPTED
        return EXIT_CRASHED if run.lost else 0

    def _existing(self) -> Existing:
        from leaderboard.running.runner import Existing

        if self.resume:
            return Existing.RESUME
        return Existing.OVERWRITE if self.overwrite else Existing.REFUSE


def plain_name(name: str) -> str:
    """A name that can be part of a folder's: `path/to/mine.py:MyAgent` becomes `MyAgent`."""
    from di_envs.files.plain_text import file_name

    return file_name(name.rpartition(":")[2].replace("/", "_"))


def default_folder(agent: str, suite: str, *, last: bool) -> Path:
    """`results/AGENT-SUITE`, or -2 and so on where that is taken.

    Args:
        agent: Its name.
        suite: Where it drives.
        last: The last one that there is, to go on with it.
    """
    name = f"{plain_name(agent)}-{plain_name(suite)}"
    folder, number = Path("results") / name, 2
    found = folder
    while folder.exists():
        found, folder, number = folder, Path("results") / f"{name}-{number}", number + 1
    return found if last else folder


def remove_if_empty(folder: Path) -> None:
    """Leaves no empty folder behind where nothing could be driven."""
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def _print_run(run: RunRecord, folder: Path) -> None:
    from leaderboard.records.results import CARLA_FILE, RECORD_FILE
    from leaderboard.tables.run_tables import print_run

    print_run(run, Terminal())
    say(
        f"Written: {folder / CARLA_FILE} (CARLA's schema) and {folder / RECORD_FILE} (all of it).",
        *_next_steps(run, folder),
    )


def _next_steps(run: RunRecord, folder: Path) -> list[str]:
    """Commands that make sense now."""
    where = typed(folder)
    if run.lost or not run.complete:
        return [f"Next: the same command with --output {where} --resume drives what is missing"]
    route = typed(run.scored[0].route_id)
    return [
        f"Next: driveinsight report {where}       a page with a replay of each route",
        f"      driveinsight explain {where} --route {route}       why it drove one so",
        f"      driveinsight verify {where}       does the claim stand?",
        f"      driveinsight compare {where} OTHER",
        f"      driveinsight show {where}       this table again",
    ]
