"""`driveinsight explain`: writes a recorded route as a page that shows what moved its agent."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from leaderboard.commands.ending import UsageError, say, typed
from leaderboard.commands.scene_arguments import says
from leaderboard.commands.trusting import trusted_run
from leaderboard.running.displays.work_bar import work_bar
from leaderboard.running.terminal import Terminal

EXPLAIN_HELP = """Show why an agent drove a route as it did: one HTML page to look at.

Examples:
  driveinsight explain results/mine --route 3
  driveinsight explain results/mine --route 3 --at 12.5 --what-if "drop:traffic_lights; set:speed=0"
  driveinsight explain results/mine --route 3 --at 12.5 --what-if "remove:actor=17; mask:bev,p=0.5"

The page replays the drive beside the front camera's picture, with what the agent was told (routing,
target point, map, obstacles, lights), the path that its policy predicts, gradients and attention of
each component at the cursor, and activation maps. --what-if adds, for each edit joined by `;`, what
the agent would have decided at the moment --at, and how it would have gone on from there.

The agent drives the route again, compared with the record at every decision. One that cannot be
looked into (no torch policy that names its tokens) still gets the replay, the prompt and what if.
In Python: leaderboard.explaining.route.explain_route. See docs/explain_page.md."""


@dataclass(frozen=True, kw_only=True)
class Explain:
    """The arguments of `driveinsight explain`."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run's output folder."""

    route: Annotated[str, tyro.conf.arg(metavar="ID")]
    """Id of the route."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Which of the run's seeds."""

    at: Annotated[float | None, says("SECONDS", "the start")] = None
    """Game time at which the page opens, and of the moment that --what-if is about."""

    what_if: Annotated[str, says("EDITS", "none")] = ""
    """Edits, each a question of its own, such as "drop:routing; set:speed=0; remove:actor=17"."""

    ahead: Annotated[float, tyro.conf.arg(metavar="SECONDS")] = 15.0
    """How far the agent drives on with each edit."""

    every: Annotated[float, tyro.conf.arg(metavar="SECONDS")] = 0.2
    """How often the agent is looked into, and a picture taken."""

    agent: Annotated[str | None, says("AGENT", "the run's")] = None
    """Where the agent is found now, if its weights have moved; one of yours that the folder names
    needs it, or --trust."""

    trust: tyro.conf.FlagCreatePairsOff[bool] = False
    """Run what the folder names: an agent or edits that are not ours."""

    output: Annotated[Path | None, says("FILE", "explain-ROUTE.html in RUN")] = None
    """The page's file."""

    def run(self) -> int:
        """Writes the page; returns the exit code."""
        from di_envs.edits.text import EditError
        from di_envs.files.plain_text import file_name
        from leaderboard.explaining.questions import read_asked
        from leaderboard.records.chosen_route import RouteChoiceError, chosen_route
        from leaderboard.records.results import ResultsError, read_run, run_folder

        try:
            what_if = read_asked(self.what_if)
            folder = run_folder(self.folder)
            run = read_run(folder)
            chosen_route(run, self.route, self.seed)
        except (EditError, ResultsError, RouteChoiceError) as error:
            raise UsageError(str(error)) from error
        run = trusted_run(run, agent=self.agent, trust=self.trust)

        from leaderboard.explaining.explanation import ExplainError
        from leaderboard.explaining.route import explain_route
        from leaderboard.pages.explain_page import explain_page
        from leaderboard.pages.report_page import ReportError, write_report
        from leaderboard.replaying.recorded_agent import RetraceError
        from leaderboard.replaying.replay import ReplayError
        from leaderboard.running.compiling import compile_progress

        console = Terminal(stderr=True)
        path = self.output or folder / f"explain-{file_name(self.route)}.html"
        try:
            bar = work_bar("explaining", "decisions", console=console, transient=True)
            with compile_progress(console), bar:
                task = bar.add_task("", total=None)
                explanation = explain_route(
                    run,
                    self.route,
                    seed=self.seed,
                    every_s=self.every,
                    at_s=self.at,
                    what_if=what_if,
                    ahead_s=self.ahead,
                    on_progress=lambda done, total: bar.update(task, completed=done, total=total),
                )
            size = write_report(path, explain_page(explanation))
        except (EditError, ExplainError, ReplayError, ReportError, RetraceError) as error:
            raise UsageError(str(error)) from error
        say(*explanation.missing)
        say(
            f"Written: {path} ({size / 1e6:.1f} MB, {len(explanation.times_s)} looks at "
            f"{explanation.record.game_s:.1f} s of driving), open it in a browser"
        )
        if explanation.what_if is None:
            at_s = explanation.record.game_s / 2.0
            say(
                f"Next: driveinsight explain {typed(folder)} --route {typed(self.route)} "
                f"--at {at_s:.1f} "
                '--what-if "drop:routing; set:speed=0"'
            )
        return 0
