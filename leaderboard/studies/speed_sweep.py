"""What a policy plans when it is told another speed: a dose-response curve, without driving.

At moments of recorded drives the policy is asked once more, with everything as it was but the given
speed. It is asked twice: with the present speed alone edited, as the paper did, and with the past
ones too, as the two contradict each other otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from agents.one_thread import one_thread
from agents.processes import in_order, processes
from di_envs.files.json_text import JsonError, one_line, read_json
from di_envs.files.json_values import from_json
from di_envs.files.whole import write_whole
from leaderboard.records.record import RouteRecord
from leaderboard.records.results import read_run
from leaderboard.replaying.recorded_agent import retrace_env, run_agent
from leaderboard.replaying.retracing import retrace
from leaderboard.running.displays.work_bar import work_bar
from leaderboard.running.episode import close_agent
from leaderboard.running.interventions import seen_space
from leaderboard.statistics.bootstrap import expanded_interval
from leaderboard.statistics.claim_verdict import ClaimVerdict, verdict_of_interval
from leaderboard.studies import StudyError
from leaderboard.studies.effects import ALPHA, Effect, effect
from leaderboard.studies.experiments import Judgement
from leaderboard.studies.numbers import effect_numbers, span_text
from wrappers.interventions.editing import ObservationEditing
from wrappers.interventions.values import SetValue

DOSES_MPS = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 12.5, 15.0)
TARGETS = ("speed", "speed+speed_history")
EVERY = 25  # decisions between two moments
SLOW_MPS, FAST_MPS = 0.0, 10.0  # the paper's two
MUCH = 0.25  # the share of the unedited path by which the two must differ to be called far apart
FOLDER, FORMAT = "speed", "driveinsight-speed-sweep-1"

Lengths = dict[str, Any]  # of a drive: episode, moments, mean path lengths [m]


def sweep(folder: Path, workers: int, console: Console) -> list[Lengths]:
    """Asks the policy at moments of the baseline's drives of seed 0; keeps what was asked before.

    Args:
        folder: Of the study.
        workers: Processes.
        console: Where progress is shown.

    Raises:
        StudyError: If a drive cannot be asked about.
    """
    run_folder = folder / "rows" / "baseline"
    records = [record for record in read_run(run_folder).scored if record.seed == 0]
    missing = [record.index for record in records if _kept(folder, record) is None]
    bar = work_bar("asking  ", "drives", console=console, transient=True)
    with bar:
        task = bar.add_task("", total=len(records), completed=len(records) - len(missing))
        for _ in _asked(folder, missing, workers):
            bar.advance(task)
    found = [_kept(folder, record) for record in records]
    return [each for each in found if each is not None and each["moments"]]


def _asked(folder: Path, indices: Sequence[int], workers: int) -> Iterator[None]:
    if workers == 1 or len(indices) < 2:
        for index in indices:
            ask_about(folder, index)
            yield
        return
    with processes(workers) as pool:
        try:
            yield from in_order(pool, partial(ask_about, folder), indices, ahead=2 * workers)
        except ChildProcessError as error:
            raise StudyError(str(error)) from error


def ask_about(folder: Path, index: int) -> None:
    """Asks at moments of one drive, and keeps the answers in a file of its own.

    Raises:
        StudyError: If its agent's policy gives no waypoints, or does not drive as recorded.
    """
    import torch

    from agents.explain.protocol import NotExplainableError, explainable
    from leaderboard.replaying.recorded_agent import RetraceError
    from leaderboard.replaying.replay import ReplayError

    run = read_run(folder / "rows" / "baseline")
    record = next(record for record in run.routes if record.index == index)
    env = retrace_env(run)
    agent = run_agent(run, env)
    space = seen_space(run.requires["observations"], env.config)
    edits = {
        (target, dose): ObservationEditing(
            (SetValue(targets=tuple(target.split("+")), number=dose),), space
        )
        for target in TARGETS
        for dose in DOSES_MPS
    }
    rows: list[list[float]] = []
    try:
        policy = explainable(agent)
        for decision in retrace(run, record, agent=agent, env=env):
            if decision.control is None or decision.number % EVERY:
                continue
            with one_thread(), torch.no_grad():
                lengths = [path_length(policy.waypoints(decision.seen, decision.memory).numpy())]
                for editing in edits.values():
                    seen, _ = editing.apply(decision.seen, decision.context, editing.start())
                    lengths.append(path_length(policy.waypoints(seen, decision.memory).numpy()))
            rows.append(lengths)
    except (NotExplainableError, RetraceError, ReplayError) as error:
        raise StudyError(str(error)) from error
    finally:
        close_agent(agent)
        env.close()
    _keep(folder, record, rows)


def path_length(waypoints: NDArray[Any]) -> float:
    """Of the way from the ego through (T, 2) waypoints [m]."""
    steps = np.diff(np.asarray(waypoints, float), axis=0, prepend=0.0)
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def _keep(folder: Path, record: RouteRecord, rows: Sequence[Sequence[float]]) -> None:
    means = [math.fsum(column) / len(rows) for column in zip(*rows, strict=True)]
    count = len(DOSES_MPS)
    content = {
        "format": FORMAT,
        "episode": record.state_hash,
        "route_id": record.route_id,
        "route_hash": record.route_hash,
        "seed": record.seed,
        "moments": len(rows),
        "doses_mps": DOSES_MPS,
        "unedited_m": means[0] if means else None,
        **{
            target: means[1 + place * count : 1 + (place + 1) * count]
            for place, target in enumerate(TARGETS)
        },
    }
    write_whole(_path(folder, record), one_line(content))


def _kept(folder: Path, record: RouteRecord) -> Lengths | None:
    """What was asked of a drive before; None if nothing, or of another drive."""
    try:
        content = read_json(_path(folder, record))
    except JsonError:
        return None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        return None
    try:
        answer = from_json(_Answer, content, "answer", foreign=True)
        asked = [from_json(tuple[float, ...], content.get(name), name) for name in TARGETS]
    except JsonError:
        return None
    whole = answer.unedited_m is not None and all(len(each) == len(DOSES_MPS) for each in asked)
    if answer.moments and not whole:
        return None
    same = content.get("episode") == record.state_hash
    return content if same and content.get("doses_mps") == list(DOSES_MPS) else None


@dataclass(frozen=True, kw_only=True)
class _Answer:
    """What is read of a file of answers."""

    episode: str
    route_hash: str
    moments: int
    unedited_m: float | None
    doses_mps: tuple[float, ...]


def _path(folder: Path, record: RouteRecord) -> Path:
    plain = "".join(c if c.isalnum() or c in "-_" else "_" for c in record.route_id)
    return folder / FOLDER / f"{plain}-{record.seed}.json"


def judge_speed(drives: Sequence[Lengths]) -> Judgement | None:
    """Whether the policy plans near waypoints when it is told that it stands, and far ones if not.

    Returns:
        None without drives.
    """
    if not drives:
        return None
    routes = [drive["route_hash"] for drive in drives]
    slow, fast = (DOSES_MPS.index(dose) for dose in (SLOW_MPS, FAST_MPS))
    unedited = float(np.mean([drive["unedited_m"] for drive in drives]))
    gains = {
        target: effect(
            [drive[target][fast] - drive[target][slow] for drive in drives],
            routes,
            tests=len(TARGETS),
            margin=MUCH * unedited,
        )
        for target in TARGETS
    }
    said = []
    for target, gain in gains.items():
        near, far = (float(np.mean([d[target][dose] for d in drives])) for dose in (slow, fast))
        name = target.replace("+", " and ").replace("_", " ")
        said.append(
            f"{name} given as {SLOW_MPS:g} m/s: a path of {near:.1f} m, as {FAST_MPS:g} m/s "
            f"{far:.1f} m, {gain.mean:+.1f} m ({span_text(gain, digits=1)})"
        )
    said.append(f"unedited {unedited:.1f} m")
    return Judgement(
        experiment="speed",
        verdict=_verdict(gains["speed"]),
        sentence="; ".join(said),
        numbers={
            "doses_mps": list(DOSES_MPS),
            "unedited_m": unedited,
            "moments": sum(drive["moments"] for drive in drives),
            "curves": {target: _curve(drives, routes, target) for target in TARGETS},
            "gains": {target: effect_numbers(gain) for target, gain in gains.items()},
        },
    )


def _curve(
    drives: Sequence[Lengths], routes: Sequence[str], target: str
) -> Mapping[str, list[float | None]]:
    """Mean path length at each dose, with a 95 % interval of each by itself."""
    curve: dict[str, list[float | None]] = {"mean": [], "low": [], "high": []}
    for dose in range(len(DOSES_MPS)):
        found = effect([drive[target][dose] for drive in drives], routes)
        ends: tuple[float | None, float | None] = (None, None)
        if found.means is not None:
            ends = expanded_interval(found.means, found.routes, ALPHA / 2.0)
        curve["mean"].append(found.mean)
        curve["low"].append(ends[0])
        curve["high"].append(ends[1])
    return curve


def _verdict(gain: Effect) -> ClaimVerdict:
    return verdict_of_interval(
        gain.low, gain.high, holds_above=gain.margin, fails_below=gain.margin
    )
