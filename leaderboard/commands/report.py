"""`driveinsight report`: writes a run as one HTML page with a replay of each route."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from leaderboard.commands.ending import UsageError, complain, say
from leaderboard.commands.scene_arguments import says
from leaderboard.running.displays.work_bar import work_bar
from leaderboard.running.terminal import Terminal

REPORT_HELP = """Write a run as one HTML page: tables, infractions on a map, replays of routes.

Examples:
  driveinsight report results/expert-town05_long
  driveinsight report results/mine --route-ids 3 7 --output routes-3-and-7.html

The page holds all that it needs: open it in any browser, without a network, or send it to somebody.
`#route=3&seed=0&t=12.5` behind its address opens that moment of a replay."""


@dataclass(frozen=True, kw_only=True)
class Report:
    """The arguments of `driveinsight report`."""

    path: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run's output folder, or results.json or driveinsight.json in it."""

    output: Annotated[Path | None, says("FILE", "report.html in RUN")] = None
    """The page's file."""

    route_ids: Annotated[tuple[str, ...], says("ID ...", "all")] = ()
    """Only these routes."""

    def run(self) -> int:
        """Writes the page; returns the exit code."""
        from leaderboard.records.results import ResultsError, read_run, run_folder

        try:
            folder = run_folder(self.path)
            run = read_run(folder)
        except ResultsError as error:
            raise UsageError(str(error)) from error

        from leaderboard.pages.report_page import (
            ReportError,
            chosen_routes,
            make_report,
            write_report,
        )
        from leaderboard.running.compiling import compile_progress

        console = Terminal(stderr=True)
        path = self.output or folder / "report.html"
        try:
            count = len(chosen_routes(run, self.route_ids))
            bar = work_bar("replaying", "routes", console=console, transient=True)
            with compile_progress(console), bar:
                task = bar.add_task("", total=count)
                page, films = make_report(run, self.route_ids, lambda film: bar.advance(task))
            size = write_report(path, page)
        except ReportError as error:
            raise UsageError(str(error)) from error
        for film in films:
            if film.problem:
                name = f"route {film.record.route_id}, seed {film.record.seed}"
                complain(f"{name} has no replay: {film.problem}", "warning", "yellow")
        shown = sum(bool(film.block) for film in films)
        say(
            f"Written: {path} ({size / 1e6:.1f} MB, replays of {shown} of {len(films)} routes), "
            "open it in a browser"
        )
        return 0
