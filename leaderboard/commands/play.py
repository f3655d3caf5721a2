"""`driveinsight play`: a person drives a route in a window, and is scored as any agent."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from leaderboard.commands.ending import UsageError, say, typed
from leaderboard.commands.evaluate import default_folder, remove_if_empty
from leaderboard.commands.scene_arguments import SceneArguments, says
from leaderboard.running.terminal import Terminal

PLAY_HELP = """Drive a route yourself, in a window, and be scored as agents are.

Examples:
  driveinsight play --suite town05_short --route 5
  driveinsight play --suite town05_short --route 5 --gamepad

Arrows or W A S D drive, space brakes hard; on a gamepad the left stick steers, the right trigger is
throttle, the left one brake. P pauses, + and - change the speed, C shows the front camera or the
streets alone, Esc or closing the window gives the route up. The drive is kept as a run:
`driveinsight watch`, `report`, `verify` and `compare` take it."""


@dataclass(frozen=True, kw_only=True)
class Play(SceneArguments):
    """The arguments of `driveinsight play`."""

    # Of scenes, but nothing that a person could be told
    agent: tyro.conf.Suppress[str] = ""
    intervene: tyro.conf.Suppress[str] = ""
    no_isolate: tyro.conf.Suppress[bool] = False
    trust: tyro.conf.Suppress[bool] = False

    route: Annotated[str | None, says("ID", "the first")] = None
    """Id of the route to drive."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Which seed's world to drive in."""

    gamepad: tyro.conf.FlagCreatePairsOff[bool] = False
    """Drive by a gamepad; without, by the keyboard."""

    output: Annotated[Path | None, says("DIR", "a new one in results/")] = None
    """Folder for the result files."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace results that the folder holds already."""

    def run(self) -> int:
        """Drives; returns the exit code."""
        options, suite = self.choose(() if self.route is None else (self.route,))

        from leaderboard.records.own_files import prepare_folder
        from leaderboard.records.results import ResultsError
        from leaderboard.running.interruption import interruptible
        from leaderboard.running.jobs import RunSpec, SetupError
        from leaderboard.running.playing import PlayEngine
        from leaderboard.running.runner import Existing, evaluate
        from leaderboard.tables.run_tables import print_run

        route_id = self.route or suite.specs(suite.town_path.stem)[0].route_id
        options["route_ids"] = (route_id,)
        spec = RunSpec(
            agent="human:gamepad" if self.gamepad else "human:keyboard",
            options=options,
            rules=self.rules,
        )
        folder = self.output or default_folder("human", suite.name, last=False)
        new = not folder.exists()
        try:
            prepare_folder(folder, overwrite=self.overwrite)  # before a window opens
            with interruptible(ends_process=True) as interruption:
                engine = PlayEngine(
                    spec, Terminal(stderr=True), stopped=lambda: interruption.requested
                )
                try:
                    run = evaluate(
                        spec,
                        (self.seed,),
                        suite=suite,
                        folder=folder,
                        engine=engine,
                        existing=Existing.OVERWRITE if self.overwrite else Existing.REFUSE,
                    )
                finally:
                    engine.close()
        except (SetupError, ResultsError) as error:
            raise UsageError(str(error)) from error
        finally:
            if new:
                remove_if_empty(folder)
        print_run(run, Terminal())
        where = typed(folder)
        say(
            f"Written: {folder}",
            f"Next: driveinsight watch {where}       the drive once more, in the window",
            f"      driveinsight report {where}       a page with its replay",
            f"      driveinsight verify {where}       does the score stand?",
        )
        return 0
