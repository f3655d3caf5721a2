"""Drives a study: each row an ordinary run, seed by seed, so that a study cut short is balanced.

First the baseline, then the null row, whose edit edits nothing: unless it is the baseline to the
bit, differences between rows would mean nothing, and the study stops there. What a run holds
already is kept, so repeating a command goes on, and more seeds or rows add to what is there.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from di_envs.files.whole import unfinished
from di_envs.suites import Suite
from leaderboard.records.folder_lock import LOCK_FILE, folder_lock
from leaderboard.records.footing import record_differences
from leaderboard.records.own_files import refuse_others
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.records.results import RECORD_FILE, DamagedError, read_head
from leaderboard.records.resuming import resumed
from leaderboard.replaying.recorded_edits import code_of_edits
from leaderboard.running.compiling import compile_progress
from leaderboard.running.displays.study import StudyDisplay
from leaderboard.running.interruption import interruptible
from leaderboard.running.interventions import texts_of
from leaderboard.running.jobs import RunSpec, plan_jobs
from leaderboard.running.messages import RunFacts
from leaderboard.running.runner import Existing, evaluate, new_run
from leaderboard.running.terminal import Terminal
from leaderboard.running.workers.local_engine import Engine, LocalEngine
from leaderboard.studies import StudyError
from leaderboard.studies.looking_ahead import look_ahead
from leaderboard.studies.more_seeds import recover_run, replace_run, with_seeds
from leaderboard.studies.record import DrivenRow, Study, StudyDrive, study_of
from leaderboard.studies.rows import BASELINE, BASELINE_ROW, NULL, NULL_ROW, Row
from leaderboard.studies.study_file import STUDY_FILE, read_study

ROWS_FOLDER = "rows"
# What must be as it was for a study to go on; rows and seeds may come to it
_SAME = (
    *("kind", "agent", "agent_version", "requires", "suite", "suite_version", "options", "rules"),
    *("town_hash", "routes_hash", "interventions", "versions", "cpu", "isolated"),
)


@dataclass(frozen=True, kw_only=True)
class StudyPlan:
    """What is to be driven.

    Attributes:
        kind: Of study.
        spec: Agent, options, rules, and edits that all rows share.
        suite: The set of routes that the options name.
        rows: Without the baseline and the null row.
    """

    kind: str
    spec: RunSpec
    suite: Suite
    rows: tuple[Row, ...]


def drive_study(
    plan: StudyPlan,
    seeds: int,
    *,
    folder: Path,
    engine: Engine | None = None,
    console: Console | None = None,
    keep: Callable[[Study], None],
) -> tuple[Study, bool]:
    """Drives what is missing of a study.

    Args:
        plan: The study.
        seeds: How many; those that the folder holds are among them.
        folder: Where its runs are.
        engine: Where routes are driven; None for one process beside this one.
        console: Where progress is shown.
        keep: Called with the study whenever there is more of it: writes it down.

    Returns:
        The study, and whether it was interrupted (SIGINT or SIGTERM).

    Raises:
        StudyError: If the folder holds another study, if no row can be driven, or if the null row
            is not the baseline to the bit.
        SetupError: If the agent or an option is wrong.
        ResultsError: If the folder cannot be written to, or is in use.
    """
    console = console or Terminal(stderr=True)
    with folder_lock(folder), interruptible() as interruption:
        _check_folder(folder)
        earlier = _earlier(folder)
        with compile_progress(console):
            scene, reasons = look_ahead(plan.spec, plan.rows)
        driving = _Driving(plan, scene, reasons, folder, earlier, seeds)
        keep(driving.study())
        engine = engine or LocalEngine()
        with StudyDisplay(console) as display, suppress(KeyboardInterrupt):
            for name, count in driving.steps(display):
                driving.drive_row(name, count, engine, console, display, keep)
                if interruption.requested:
                    break
        return driving.study(), interruption.requested


def _check_folder(folder: Path) -> None:
    """Refuses a folder that holds neither a study, nor runs of one, but something else."""
    baseline = folder / ROWS_FOLDER / BASELINE / RECORD_FILE
    if not ((folder / STUDY_FILE).exists() or baseline.exists()):
        left = {folder / LOCK_FILE, *unfinished(folder, re.escape(STUDY_FILE))}
        refuse_others(folder, [path for path in folder.iterdir() if path not in left])


def _earlier(folder: Path) -> Study | None:
    """What the folder holds of a study; None if nothing."""
    return read_study(folder) if (folder / STUDY_FILE).exists() else None


def _ours(folder: Path, driven: DrivenRow, plan: StudyPlan) -> DrivenRow:
    """A row that the folder holds; refused if going on with it would run code that it names."""
    code = [] if driven.row in plan.rows else list(code_of_edits(driven.row.edit.split(";")))
    if code:
        raise StudyError(
            f"{folder / STUDY_FILE}: row '{driven.row.name}' is an edit that is not ours, "
            f"{', '.join(code)}, and nobody asked for it: choose another --output"
        )
    return driven


class _Driving:
    """The books of a study: its runs, what they hold, and what is missing."""

    def __init__(
        self,
        plan: StudyPlan,
        scene: RunFacts,
        reasons: dict[str, str],
        folder: Path,
        earlier: Study | None,
        seeds: int,
    ) -> None:
        self._plan, self._scene, self._folder = plan, scene, folder
        self._seeds = seeds
        self._head = study_of(plan.kind, self._run_head(BASELINE_ROW, range(seeds)), ())
        shared = texts_of(plan.spec.interventions)
        self._head = dataclasses.replace(self._head, interventions=shared)
        if earlier is not None:
            _check_same(folder, earlier, self._head)
            if len(earlier.seeds) > seeds:
                raise StudyError(
                    f"{folder} has {len(earlier.seeds)} seeds; more can be added, none taken away:"
                    f" pass --seeds {len(earlier.seeds)} or more, or choose another --output"
                )
        self._rows = {BASELINE: DrivenRow(row=BASELINE_ROW), NULL: DrivenRow(row=NULL_ROW)}
        for driven in earlier.rows if earlier else ():
            self._rows.setdefault(driven.row.name, _ours(folder, driven, plan))
        for row in plan.rows:
            self._rows[row.name] = DrivenRow(row=row, left_out=reasons[row.name])
        self._extra = dict(earlier.extra) if earlier else {}
        if plan.rows and all(self._rows[row.name].left_out for row in plan.rows):
            why = "; ".join(dict.fromkeys(reasons.values()))
            raise StudyError(
                f"there is nothing to study with agent '{plan.spec.agent}': no row can be driven "
                f"({why})"
            )
        self._runs = {
            name: self._found(driven.row)
            for name, driven in self._rows.items()
            if not driven.left_out
        }
        self._chosen = (BASELINE, NULL, *(row.name for row in plan.rows if row.name in self._runs))

    def study(self) -> Study:
        """All that there is so far."""
        rows = []
        for name, driven in self._rows.items():
            run = self._runs.get(name)
            if run is not None:
                drives = tuple(StudyDrive.of(record) for record in run.scored)
                driven = dataclasses.replace(driven, planned=run.planned, drives=drives)
            rows.append(driven)
        return dataclasses.replace(self._head, rows=tuple(rows), extra=self._extra)

    def steps(self, display: StudyDisplay) -> Iterator[tuple[str, int]]:
        """What to drive, in order: rows, and up to how many seeds."""
        planned = len(self._scene.route_ids) * self._seeds * len(self._chosen)
        display.plan_study(planned, sum(len(self._runs[n].scored) for n in self._chosen))
        for count in range(1, self._seeds + 1):
            for name in self._chosen:
                yield name, count

    def drive_row(
        self,
        name: str,
        count: int,
        engine: Engine,
        console: Console,
        display: StudyDisplay,
        keep: Callable[[Study], None],
    ) -> None:
        """Drives what is missing of one row up to a number of seeds."""
        run, row = self._runs[name], self._rows[name].row
        if len(run.seeds) < count:
            run = with_seeds(run, self._scene.route_ids, range(count))
            if (self._row_folder(row) / RECORD_FILE).exists():
                replace_run(self._row_folder(row), run)
            self._runs[name] = run
        if len(run.scored) < run.planned:
            self._runs[name] = self._driven(row, run, engine, console, display)
            keep(self.study())
        if name == NULL:
            self._check_null()

    def _driven(
        self,
        row: Row,
        run: RunRecord,
        engine: Engine,
        console: Console,
        display: StudyDisplay,
    ) -> RunRecord:
        display.row(row.name)
        return evaluate(
            self._spec(row),
            run.seeds,
            suite=self._plan.suite,
            folder=self._row_folder(row),
            engine=engine,
            existing=Existing.RESUME,
            console=console,
            display=display,
        )

    def _check_null(self) -> None:
        """The null row is the baseline to the bit, or nothing here means anything."""
        theirs = {(record.route_id, record.seed): record for record in self._runs[NULL].scored}
        for record in self._runs[BASELINE].scored:
            null = theirs.get((record.route_id, record.seed))
            if null is not None and _bits(null) != _bits(record):
                raise StudyError(
                    f"the null row, whose edit edits nothing, is not the baseline on route "
                    f"{record.route_id}, seed {record.seed}: DS {null.score.driving_score:.2f}, "
                    f"not {record.score.driving_score:.2f}. Agent '{self._plan.spec.agent}' does "
                    "not drive the same way twice, so a difference between rows would say "
                    "nothing of the edit: make its random numbers a function of the seed"
                )

    def _run_head(self, row: Row, seeds: Sequence[int]) -> RunRecord:
        jobs = plan_jobs(self._scene.route_ids, tuple(seeds))
        return new_run(self._spec(row), jobs, self._plan.suite, self._scene)

    def _spec(self, row: Row) -> RunSpec:
        edits = (*self._plan.spec.interventions, *row.edits)
        return dataclasses.replace(self._plan.spec, interventions=edits)

    def _row_folder(self, row: Row) -> Path:
        return self._folder / ROWS_FOLDER / row.name

    def _found(self, row: Row) -> RunRecord:
        """The row's run with what its folder holds; over one seed if it holds nothing."""
        folder = self._row_folder(row)
        recover_run(folder)
        seeds: Sequence[int] = (0,)
        if (folder / RECORD_FILE).exists():
            try:
                seeds = read_head(folder).seeds
            except DamagedError:
                seeds = range(self._seeds)
        return resumed(folder, self._run_head(row, seeds))


def _bits(record: RouteRecord) -> object:
    """All of a drive but its place in the run and the edits' names."""
    return dataclasses.replace(record, index=0, interventions=()).fingerprint()


def _check_same(folder: Path, earlier: Study, now: Study) -> None:
    """Refuses to go on with another study."""
    if found := record_differences(earlier, now, _SAME):
        said = "; ".join(difference.was_is for difference in found)
        raise StudyError(
            f"{folder} holds another study, its results would mix: {said}. Repeat the command as "
            "it was, or choose another --output"
        )
