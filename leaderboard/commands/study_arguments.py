"""What the commands that drive studies share: their arguments, and how a study is driven.

Each says what it studies by a `StudyQuestion`; `run_study` does the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

from leaderboard.commands.ending import EXIT_CRASHED, EXIT_INTERRUPTED, UsageError, complain, say
from leaderboard.commands.engine_arguments import EngineArguments
from leaderboard.commands.evaluate import plain_name
from leaderboard.commands.scene_arguments import SceneArguments, says

if TYPE_CHECKING:
    from leaderboard.studies.record import Study
    from leaderboard.studies.rows import Row


@dataclass(frozen=True, kw_only=True)
class StudyArguments(EngineArguments, SceneArguments):
    """Whom to study, where, and how much."""

    agent: Annotated[str, says("AGENT", "none; not needed with --show")] = ""
    """A name or a scheme (see `driveinsight agents`), module:Class, or path/to/file.py:Class."""

    seeds: Annotated[int, says("N", "1")] = 1
    """How many seeds to drive every route with: 3 means 0, 1 and 2."""

    route_ids: Annotated[tuple[str, ...], says("ID ...", "all")] = ()
    """Drive these routes only."""

    output: Annotated[Path | None, says("STUDY", "results/KIND-AGENT-SUITE")] = None
    """Folder of the study; what it holds already is kept."""

    show: Annotated[Path | None, says("STUDY", "none")] = None
    """Drive nothing: show the study in this folder, and draw its table and figures anew."""


class StudyQuestion(Protocol):
    """What a command asks: which rows are driven, what is measured on them, what is shown."""

    @property
    def kind(self) -> str:
        """Of study."""
        ...

    def rows(self) -> Sequence[Row]:
        """What is to be driven beside the baseline and the null row."""
        ...

    def measured(self, study: Study, folder: Path) -> Study:
        """The study with what is measured once all is driven."""
        ...

    def print_study(self, study: Study, folder: Path) -> list[str]:
        """Draws and prints a study; returns lines that name the next step."""
        ...


def run_study(arguments: StudyArguments, question: StudyQuestion) -> int:
    """Drives the study, or shows one; returns the exit code."""
    from leaderboard.records.results import ResultsError
    from leaderboard.running.jobs import SetupError
    from leaderboard.studies import StudyError

    try:
        if arguments.show is not None:
            return _show(arguments.show, question)
        return _drive(arguments, question)
    except (StudyError, SetupError, ResultsError) as error:
        raise UsageError(str(error)) from error


def _show(path: Path, question: StudyQuestion) -> int:
    from leaderboard.studies import StudyError
    from leaderboard.studies.study_file import read_study

    study = read_study(path)
    if study.kind != question.kind:
        raise StudyError(
            f"{path} is a study of another kind, {study.kind}: show it with the command that made "
            "it"
        )
    _print(study, path if path.is_dir() else path.parent, question)
    return 0


def _drive(arguments: StudyArguments, question: StudyQuestion) -> int:
    if not arguments.agent:
        raise UsageError("say whom to study: --agent driveinsight (`driveinsight agents`)")
    if arguments.seeds < 1:
        raise UsageError("--seeds must be at least 1")
    arguments.check_engine()
    rows = tuple(question.rows())
    options, suite = arguments.choose(arguments.route_ids)
    name = f"{question.kind}-{plain_name(arguments.agent)}-{plain_name(suite.name)}"
    folder = arguments.output or Path("results") / name.replace(" ", "-")

    from leaderboard.pages.study_files import keep_study
    from leaderboard.running.interruption import interruptible
    from leaderboard.running.jobs import RunSpec
    from leaderboard.studies.driving import StudyPlan, drive_study

    spec = RunSpec(
        agent=arguments.agent,
        options=options,
        rules=arguments.rules,
        interventions=arguments.edits(),
        isolate=not arguments.no_isolate,
    )
    engine = arguments.make_engine()
    with arguments.connected(), interruptible(ends_process=True):
        study, interrupted = drive_study(
            StudyPlan(kind=question.kind, spec=spec, suite=suite, rows=rows),
            arguments.seeds,
            folder=folder,
            engine=engine,
            keep=lambda so_far: keep_study(folder, so_far),
        )
    if not interrupted:
        try:
            study = question.measured(study, folder)
        except KeyboardInterrupt:
            interrupted = True
        keep_study(folder, study)
    _print(study, folder, question)
    if interrupted:
        complain("the same command goes on from here", "interrupted", "yellow")
        return EXIT_INTERRUPTED
    return 0 if study.complete else EXIT_CRASHED


def _print(study: Study, folder: Path, question: StudyQuestion) -> None:
    next_steps = question.print_study(study, folder)
    if study.complete:
        say(*next_steps)
    else:
        say("Next: the same command drives what is missing")
