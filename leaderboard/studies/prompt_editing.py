"""The prompt-editing experiments of a study, measured on its runs and judged."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from leaderboard.records.record import RunRecord
from leaderboard.records.results import RECORD_FILE, read_run
from leaderboard.replaying.replay import ReplayError, replay_env
from leaderboard.running.displays.work_bar import work_bar
from leaderboard.statistics.claim_verdict import ClaimVerdict
from leaderboard.studies import StudyError
from leaderboard.studies.approaches import Approach, approaches, judge_lights
from leaderboard.studies.experiments import Experiment, Judgement
from leaderboard.studies.failures import judge_bev, judge_map
from leaderboard.studies.lateral import judge_route, lateral_offsets
from leaderboard.studies.record import Study
from leaderboard.studies.rows import BASELINE
from leaderboard.studies.speed_sweep import judge_speed, sweep

JUDGEMENTS, MISSING = "judgements", "missing"  # in a study's `extra`


@dataclasses.dataclass(frozen=True, kw_only=True)
class Bench:
    """Where measures are taken: the study, its folder, and what helps.

    Attributes:
        runs: The rows' runs so far, by the row's name.
    """

    folder: Path
    study: Study
    runs: Mapping[str, RunRecord]
    workers: int
    console: Console

    def edited(self, experiment: str) -> dict[str, RunRecord]:
        """The runs of an experiment, by their edit."""
        return {
            driven.row.edit: self.runs[driven.row.name]
            for driven in self.study.rows
            if driven.row.group == experiment and driven.row.name in self.runs
        }


def judged(
    folder: Path,
    study: Study,
    experiments: Sequence[Experiment],
    *,
    workers: int,
    console: Console,
) -> Study:
    """The study with a judgement of each of the experiments, or why there is none.

    Judgements of other experiments that it holds already are kept.

    Raises:
        StudyError: If a run cannot be measured here.
    """
    runs = {
        driven.row.name: read_run(folder / "rows" / driven.row.name)
        for driven in study.rows
        if (folder / "rows" / driven.row.name / RECORD_FILE).exists()
    }
    bench = Bench(folder=folder, study=study, runs=runs, workers=workers, console=console)
    judgements = dict(study.extra.get(JUDGEMENTS, {}))
    missing = dict(study.extra.get(MISSING, {}))
    for experiment in experiments:
        judgement, reason = _judge(experiment, bench)
        judgements.pop(experiment.name, None)
        missing.pop(experiment.name, None)
        if judgement is None:
            missing[experiment.name] = reason
        else:
            judgements[experiment.name] = dataclasses.asdict(judgement)
    extra = {**study.extra, JUDGEMENTS: judgements, MISSING: missing}
    return dataclasses.replace(study, extra=extra)


def judgements_of(study: Study) -> list[Judgement]:
    """Those that a record holds."""
    return [
        Judgement(**{**values, "verdict": ClaimVerdict(values["verdict"])})
        for values in study.extra.get(JUDGEMENTS, {}).values()
    ]


def _judge(experiment: Experiment, bench: Bench) -> tuple[Judgement | None, str]:
    """The judgement, or why there is none."""
    reasons = [
        driven.left_out for driven in bench.study.left_out if driven.row.group == experiment.name
    ]
    if experiment.rows and len(reasons) == len(experiment.rows):
        return None, "; ".join(dict.fromkeys(reasons))
    try:
        judgement = _JUDGES[experiment.name](bench)
    except ReplayError as error:
        raise StudyError(f"a run of {bench.folder} cannot be replayed here: {error}") from error
    except StudyError as error:
        if experiment.rows:
            raise
        return None, str(error)
    return judgement, "the drives met nothing that it asks about"


def _judge_route(bench: Bench) -> Judgement | None:
    before = bench.runs[BASELINE]
    env = replay_env(before)
    plans = {plan.route_id: plan for plan in env.plans}
    env.close()
    edited = bench.edited("route")
    return judge_route({edit: lateral_offsets(before, run, plans) for edit, run in edited.items()})


def _judge_lights(bench: Bench) -> Judgement | None:
    runs = {"": bench.runs[BASELINE], **bench.edited("lights")}
    env = replay_env(runs[""])
    found: dict[str, list[Approach]] = {edit: [] for edit in runs}
    bar = work_bar("replaying", "drives", console=bench.console, transient=True)
    with bar:
        task = bar.add_task("", total=sum(len(run.scored) for run in runs.values()))
        for edit, run in runs.items():
            for record in run.scored:
                found[edit] += approaches(run, record, env)
                bar.advance(task)
    env.close()
    return judge_lights(found)


_JUDGES: Mapping[str, Callable[[Bench], Judgement | None]] = {
    "route": _judge_route,
    "speed": lambda bench: judge_speed(sweep(bench.folder, bench.workers, bench.console)),
    "map": lambda bench: judge_map(bench.study),
    "lights": _judge_lights,
    "bev": lambda bench: judge_bev(bench.study),
}


def prompt_findings(study: Study) -> dict[str, Any]:
    """What was found, in sentences, for those who read the file."""
    return {each.experiment: finding_sentence(each) for each in judgements_of(study)}


def finding_sentence(judgement: Judgement) -> str:
    """The verdict and its numbers in one sentence."""
    match judgement.verdict:
        case ClaimVerdict.UNDECIDED:
            begin = "Whether the paper's finding holds is undecided"
        case verdict:
            begin = f"The paper's finding {verdict.value} here"
    return f"{begin}: {judgement.sentence}."
