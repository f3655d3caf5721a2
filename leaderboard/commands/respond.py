"""`driveinsight respond`: what a policy responds to over recorded drives, drawn and tested."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from leaderboard.commands.ending import UsageError, say, typed
from leaderboard.commands.scene_arguments import says
from leaderboard.commands.trusting import trusted_run
from leaderboard.running.displays.work_bar import work_bar
from leaderboard.running.terminal import Terminal

if TYPE_CHECKING:
    from leaderboard.records.record import RouteRecord, RunRecord
    from leaderboard.responding.drive_responses import DriveResponses

RESPOND_HELP = """Measure what a policy responds to over recorded drives: gradients and attention.

Examples:
  driveinsight respond results/mine --route 3
  driveinsight respond results/mine --route 3 --at 12.5 40 61 --every 0.1
  driveinsight respond results/mine --routes all

The agent drives the recorded route again, bit for bit, and is looked into at every --every seconds:
how the predicted waypoints change with each component's tokens (Gx, Gy), and what each attention
head attends to. One route is drawn as curves and bars with marked moments; over several, the
responses are averaged by situation and the paper's sentences are put to the test, with intervals
over routes. Any agent with a torch policy can be looked into: see docs/explaining.md."""

FOLDER = "responses"


@dataclass(frozen=True, kw_only=True)
class Respond:
    """The arguments of `driveinsight respond`."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run's output folder."""

    route: Annotated[str | None, says("ID")] = None
    """One route, which is drawn too."""

    routes: Annotated[tuple[str, ...], says("all | ID ...")] = ()
    """Several routes, with all of the run's seeds."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Which of the run's seeds, for --route."""

    every: Annotated[float, tyro.conf.arg(metavar="SECONDS")] = 0.5
    """Time between two moments that are looked at; 0.1 is every decision."""

    at: Annotated[tuple[float, ...], says("SECONDS ...", "three of different situations")] = ()
    """Moments to mark in the figures of --route."""

    agent: Annotated[str | None, says("AGENT", "the run's")] = None
    """Where the agent is found now, if its weights have moved; one of yours that the folder names
    needs it, or --trust."""

    trust: tyro.conf.FlagCreatePairsOff[bool] = False
    """Run what the folder names: an agent or edits that are not ours."""

    output: Annotated[Path | None, says("DIR", "responses in RUN")] = None
    """Folder for records, figures and tables."""

    def run(self) -> int:
        """Responds; returns the exit code."""
        from leaderboard.records.results import ResultsError, read_run, run_folder

        if (self.route is None) == (not self.routes):
            raise UsageError("say which routes: --route ID for one, or --routes all, or --routes …")
        if self.every <= 0.0:
            raise UsageError(f"--every must be positive, not {self.every:g}")
        try:
            folder = run_folder(self.folder)
            run = read_run(folder)
        except ResultsError as error:
            raise UsageError(str(error)) from error
        run = trusted_run(run, agent=self.agent, trust=self.trust)
        records = self._chosen(run)
        target = self.output or folder / FOLDER
        if self.output is None and target.is_symlink():
            raise UsageError(f"{target} leads to another folder: name one with --output")
        try:
            drives = self._measure(run, records, target)
            written = self._written(target, drives)
        except OSError as error:
            raise UsageError(f"cannot write to {target} ({error.strerror})") from error
        say(*(f"Written: {path}" for path in written), f"Next: {self._next()}")
        return 0

    def _chosen(self, run: RunRecord) -> list[RouteRecord]:
        driven = [record for record in run.scored if record.steps]
        if self.route is not None:
            wanted = [r for r in driven if (r.route_id, r.seed) == (self.route, self.seed)]
        elif self.routes == ("all",):
            wanted = driven
        else:
            known = {record.route_id for record in driven}
            missing = [name for name in self.routes if name not in known]
            wanted = [] if missing else [r for r in driven if r.route_id in self.routes]
        if not wanted:
            ids = ", ".join(dict.fromkeys(record.route_id for record in driven)) or "none"
            seeds = ", ".join(map(str, run.seeds))
            asked = self.route or " ".join(self.routes)
            raise UsageError(
                f"the run has not driven route {asked} with seed {self.seed}; driven: {ids}; its "
                f"seeds: {seeds}"
                if self.route
                else f"the run has not driven all of {asked}; driven: {ids}"
            )
        return wanted

    def _measure(
        self, run: RunRecord, records: list[RouteRecord], target: Path
    ) -> list[DriveResponses]:
        """Responses of every drive, behind a bar that counts seconds of driving."""
        from agents.explain.protocol import NotExplainableError
        from leaderboard.replaying.recorded_agent import RetraceError
        from leaderboard.replaying.replay import ReplayError
        from leaderboard.responding.measuring import measured
        from leaderboard.running.compiling import compile_progress

        begins = dict(zip([record.index for record in records], _begins(records), strict=True))
        console = Terminal(stderr=True)
        bar = work_bar("looking", "s", console=console, transient=True)
        try:
            with compile_progress(console), bar:
                task = bar.add_task("", total=round(sum(record.game_s for record in records)))

                def show(record: RouteRecord, time_s: float) -> None:
                    done = round(begins[record.index] + time_s)
                    name = f"route {record.route_id}, seed {record.seed}"
                    bar.update(task, completed=done, description=name)

                return list(measured(run, records, target, every_s=self.every, on_time=show))
        except (NotExplainableError, ReplayError, RetraceError) as error:
            raise UsageError(str(error)) from error

    def _written(self, target: Path, drives: list[DriveResponses]) -> list[Path]:
        """Figures and tables; the tables are printed too."""
        from di_envs.files.plain_text import file_name
        from leaderboard.pages.response_figures import write_figures
        from leaderboard.pages.situation_figure import situation_figure
        from leaderboard.responding.moments import marked_moments, moment_name
        from leaderboard.tables.response_tables import tables_of, write_tables

        console = Terminal()
        tables = tables_of(drives)
        for table in tables:
            console.print(table.rich())
        if self.route is None:
            paths = list(write_tables(target, drives, tables))
            picture = target / "situations.png"
            situation_figure(drives).savefig(picture)
            return [*paths, picture]
        drive = drives[0]
        marked = marked_moments(drive, self.at)
        say("Marked: " + "; ".join(moment_name(drive, index) for index in marked))
        name = f"route-{file_name(drive.route_id)}-seed-{drive.seed}"
        return list(write_figures(target, name, drive, marked))

    def _next(self) -> str:
        where = typed(self.folder)
        if self.route is None:
            return f"driveinsight respond {where} --route ID draws one of them"
        return f"driveinsight respond {where} --routes all puts the paper's claims to the test"


def _begins(records: list[RouteRecord]) -> list[float]:
    """Of each drive, the seconds driven in those before it."""
    return list(itertools.accumulate((r.game_s for r in records[:-1]), initial=0.0))
