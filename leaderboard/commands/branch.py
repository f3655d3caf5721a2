"""`driveinsight branch`: a recorded drive goes on from a moment in a changed world."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from leaderboard.commands.ending import EXIT_CRASHED, UsageError, say, typed
from leaderboard.commands.scene_arguments import says
from leaderboard.commands.trusting import trusted_run
from leaderboard.running.displays.work_bar import work_bar
from leaderboard.running.terminal import Terminal

BRANCH_HELP = """Ask what would have happened: change the world at a moment of a recorded drive.

Examples:
  driveinsight branch results/mine --route 3 --at 42.0 --world "remove:actor=17"
  driveinsight branch results/mine --route 3 --at 42.0 --world "force:light=12,state=red"
  driveinsight branch results/mine --route 3 --at 42.0 --world "move:actor=17,ahead=8"
  driveinsight branch results/mine --route 3 --at 42.0 --world "change:weather=HardRainNoon"
  driveinsight branch results/mine --route 3 --at 42.0       nothing changed: the same again

Edits are joined by `;`. Events name actors and lights by their numbers; a wrong number lists those
nearby. The agent drives the recorded part again, compared with the record at every decision, then
drives on. Writes branch.png and the edited drive, which can be shown and verified as any run."""


@dataclass(frozen=True, kw_only=True)
class Branch:
    """The arguments of `driveinsight branch`."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run's output folder."""

    route: Annotated[str, tyro.conf.arg(metavar="ID")]
    """Id of the route."""

    at: Annotated[float, tyro.conf.arg(metavar="SECONDS")]
    """Game time at which the world is changed."""

    world: Annotated[str, says("EDITS", "none")] = ""
    """What is changed, such as "remove:actor=17; force:light=3,state=red"."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Which of the run's seeds."""

    agent: Annotated[str | None, says("AGENT", "the run's")] = None
    """Where the agent is found now; one of yours that the folder names needs it, or --trust."""

    trust: tyro.conf.FlagCreatePairsOff[bool] = False
    """Run what the folder names: an agent or edits that are not ours."""

    output: Annotated[Path | None, says("DIR", "a new one in RUN")] = None
    """Folder for the picture and the edited drive."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace results that the folder holds already."""

    def run(self) -> int:
        """Branches; returns the exit code."""
        from di_envs.edits.text import EditError
        from di_envs.edits.world import read_world_edits
        from leaderboard.records.chosen_route import RouteChoiceError, chosen_route
        from leaderboard.records.own_files import prepare_folder, take_away
        from leaderboard.records.results import ResultsError, read_run, write_run

        try:
            edits = read_world_edits(self.world)
            run = trusted_run(read_run(self.folder), agent=self.agent, trust=self.trust)
            record = chosen_route(run, self.route, self.seed)
            folder = self.output or new_folder(self.folder, self.route, self.at)
            prepare_folder(folder, overwrite=self.overwrite)
        except (EditError, ResultsError, RouteChoiceError) as error:
            raise UsageError(str(error)) from error

        from leaderboard.pages.branch_picture import write_branch_picture
        from leaderboard.replaying.branch import BranchError, branch, branch_run, same_future
        from leaderboard.replaying.replay import ReplayError
        from leaderboard.tables.branch_text import branch_tables

        try:
            with work_bar("branching", "s", transient=True) as bar:
                task = bar.add_task("", total=int(record.game_s))

                def show(time_s: float) -> None:
                    bar.update(task, completed=int(time_s))

                futures = branch(run, record, self.at, edits, on_step=show)
            take_away(folder)
            write_run(folder, branch_run(run, futures))
            picture = folder / "branch.png"
            write_branch_picture(picture, run, futures)
        except (BranchError, EditError, ReplayError, ResultsError, OSError) as error:
            raise UsageError(str(error)) from error
        Terminal().print(*branch_tables(futures))
        if same_future(futures.recorded, futures.edited):
            say("Both futures are the same, to the bit.")
        say(
            f"Written: {picture} and the edited drive beside it.",
            f"Next: driveinsight watch {typed(folder)}       the edited drive, in a window",
            f"      driveinsight report {typed(folder)}       a page with its replay",
            f"      driveinsight verify {typed(folder)}       does it stand?",
        )
        return EXIT_CRASHED if futures.edited.lost else 0


def new_folder(run: Path, route_id: str, at_s: float) -> Path:
    """`RUN/branch-ROUTE-SECONDS`, or -2 and so on where that is taken."""
    from di_envs.files.plain_text import file_name

    name = f"branch-{file_name(route_id)}-{at_s:g}s"
    folder, number = run / name, 2
    while folder.exists():
        folder, number = run / f"{name}-{number}", number + 1
    return folder
