"""`driveinsight ablate`: takes away one component after the other, and says which ones matter."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from rich.console import Console

from leaderboard.commands.ending import EXIT_CRASHED, EXIT_INTERRUPTED, UsageError, say
from leaderboard.commands.engine_arguments import EngineArguments
from leaderboard.commands.evaluate import plain_name
from leaderboard.commands.scene_arguments import SceneArguments, says

if TYPE_CHECKING:
    from leaderboard.studies.record import Study

ABLATE_HELP = """Take away one component of what an agent knows after the other: which ones matter?

Examples:
  driveinsight ablate --agent driveinsight --suite town05_short
  driveinsight ablate --agent driveinsight --suite town05_short --seeds 3 --workers 2
  driveinsight ablate --agent driveinsight --suite town05_short --rows routing drop-map
  driveinsight ablate --agent mine.py:MyAgent --suite town05_tiny --only zero --route-ids 0 3 97
  driveinsight ablate --show results/ablation-driveinsight-town05_short

Each row is a run of its own in STUDY/rows, over the same worlds as the baseline: `drop` says that a
component is not given, `zero` gives zeros for its values. The table has each row's difference to
the baseline with an interval, a verdict, and the paper's Table 2 beside it; docs/studies.md says
what they mean. The same command goes on where it was stopped, and with more --seeds or --rows it
adds to what is there."""


@dataclass(frozen=True, kw_only=True)
class Ablate(EngineArguments, SceneArguments):
    """The arguments of `driveinsight ablate`."""

    agent: Annotated[str, says("AGENT", "none; not needed with --show")] = ""
    """A name or a scheme (see `driveinsight agents`), module:Class, or path/to/file.py:Class."""

    seeds: Annotated[int, says("N", "1")] = 1
    """How many seeds to drive every route with: 3 means 0, 1 and 2."""

    route_ids: Annotated[tuple[str, ...], says("ID ...", "all")] = ()
    """Drive these routes only."""

    rows: Annotated[tuple[str, ...], says("ROW ...", "all")] = ()
    """Such as drop-routing or zero:map; `routing` is both ways of it."""

    only: Annotated[Literal["drop", "zero"] | None, says("drop|zero", "both")] = None
    """One way of taking away only."""

    output: Annotated[Path | None, says("STUDY", "results/ablation-AGENT-SUITE")] = None
    """Folder of the study; what it holds already is kept."""

    show: Annotated[Path | None, says("STUDY", "none")] = None
    """Drive nothing: show the study in this folder, and draw its table and figure anew."""

    def run(self) -> int:
        """Drives the study, or shows one; returns the exit code."""
        from leaderboard.jobs import SetupError
        from leaderboard.results import ResultsError
        from leaderboard.studies.study_error import StudyError

        try:
            if self.show is not None:
                return self._show(self.show)
            return self._drive()
        except (StudyError, SetupError, ResultsError) as error:
            raise UsageError(str(error)) from error

    def _show(self, path: Path) -> int:
        from leaderboard.studies.results import ABLATION
        from leaderboard.studies.study_error import StudyError
        from leaderboard.studies.study_file import read_study

        study = read_study(path)
        if study.kind != ABLATION:
            raise StudyError(f"{path} is a study of {study.kind}: driveinsight edit --show {path}")
        _print(study, path if path.is_dir() else path.parent)
        return 0

    def _drive(self) -> int:
        if not self.agent:
            raise UsageError("say whom to study: --agent driveinsight (`driveinsight agents`)")
        if self.seeds < 1:
            raise UsageError("--seeds must be at least 1")
        self.check_engine()
        from leaderboard.studies.rows import choose_rows

        rows = choose_rows(self.rows, self.only)
        options, suite = self.choose(self.route_ids)
        folder = self.output or Path("results") / (
            f"ablation-{plain_name(self.agent)}-{plain_name(suite.name)}"
        )

        from leaderboard.jobs import RunSpec
        from leaderboard.studies.driving import StudyPlan, drive_study
        from leaderboard.studies.results import ABLATION, keep_ablation

        spec = RunSpec(
            agent=self.agent, options=options, rules=self.rules, interventions=self.edits()
        )
        study, interrupted = drive_study(
            StudyPlan(kind=ABLATION, spec=spec, suite=suite, rows=rows),
            self.seeds,
            folder=folder,
            engine=self.make_engine(),
            keep=lambda so_far: keep_ablation(folder, so_far),
        )
        _print(study, folder)
        if interrupted:
            return EXIT_INTERRUPTED
        return 0 if study.complete else EXIT_CRASHED


def _print(study: Study, folder: Path) -> None:
    from leaderboard.studies.ablation import work_out
    from leaderboard.studies.ablation_table import ablation_tables
    from leaderboard.studies.results import write_ablation
    from leaderboard.studies.study_file import STUDY_FILE

    ablation = work_out(study)
    written = write_ablation(folder, ablation)
    Console().print(ablation_tables(ablation))
    say(f"Written: {', '.join(str(path) for path in [folder / STUDY_FILE, *written])}")
    if not study.complete:
        say("Next: the same command drives what is missing")
        return
    worst = min(ablation.rows, key=lambda row: row.difference.mean, default=None)
    if worst is not None:
        row = folder / "rows" / worst.driven.row.name
        say(
            f"Next: driveinsight compare {folder / 'rows' / 'baseline'} {row}",
            f"      driveinsight verify {row}       does the claim stand?",
        )
