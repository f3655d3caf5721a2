"""`driveinsight watch`: a recorded drive in the window."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from leaderboard.commands.ending import UsageError, say, typed
from leaderboard.commands.scene_arguments import says
from leaderboard.running.terminal import Terminal

WATCH_HELP = """Watch a recorded drive in a window: front camera and streets, as it was, to the bit.

Examples:
  driveinsight watch results/expert-town05_tiny
  driveinsight watch results/mine --route 3 --at 12.5

P pauses, + and - change the speed, C shows the front camera or the streets alone, Esc closes. The
end stays until the window is closed. Without a display: `driveinsight report` writes a page."""


@dataclass(frozen=True, kw_only=True)
class Watch:
    """The arguments of `driveinsight watch`."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run's output folder."""

    route: Annotated[str | None, says("ID", "the first")] = None
    """Id of the route."""

    seed: Annotated[int | None, says("N", "the run's first")] = None
    """Which of the run's seeds."""

    at: Annotated[float, tyro.conf.arg(metavar="SECONDS")] = 0.0
    """Game time from which on it is shown."""

    trust: tyro.conf.FlagCreatePairsOff[bool] = False
    """Run what the folder names: edits of the world that are not ours."""

    def run(self) -> int:
        """Shows the drive; returns the exit code."""
        from leaderboard.commands.trusting import trusted_edits
        from leaderboard.records.chosen_route import RouteChoiceError, chosen_route
        from leaderboard.records.results import ResultsError, read_run, run_folder

        try:
            folder = run_folder(self.folder)
            run = read_run(folder)
            trusted_edits(run, trust=self.trust)
            if not run.scored:
                raise UsageError("no route of the run was driven: there is nothing to watch")
            record = chosen_route(
                run,
                run.scored[0].route_id if self.route is None else self.route,
                run.seeds[0] if self.seed is None else self.seed,
            )
        except (ResultsError, RouteChoiceError) as error:
            raise UsageError(str(error)) from error

        from di_envs.edits.text import EditError
        from leaderboard.replaying.replay import ReplayError
        from leaderboard.replaying.watching import watch
        from leaderboard.running.compiling import compile_progress
        from leaderboard.running.drive import event_line, record_lines

        try:
            with compile_progress(Terminal(stderr=True)):
                until_s = watch(
                    run, record, at_s=self.at, on_event=lambda event: say(event_line(event))
                )
        except (EditError, ReplayError, RuntimeError) as error:
            raise UsageError(str(error)) from error
        if until_s < record.game_s:
            say(f"Closed at {until_s:.1f} s of {record.game_s:.1f} s.")
        say(
            *record_lines(record),
            f"Next: driveinsight report {typed(folder)}       a page with this replay",
        )
        return 0
