"""Runs on the toy town: the same bits however they are run, and no agent can stop them."""

from __future__ import annotations

import io
import json
import os
import signal
from collections.abc import Sequence
from pathlib import Path

import pytest
from rich.console import Console

from di_envs.kernels import cpu_capability
from di_envs.suites import load_suite
from leaderboard.engines import Engine, PoolEngine, SerialEngine
from leaderboard.jobs import Job, RunSpec, plan_jobs
from leaderboard.record import (
    AGENT_CRASHED,
    NOT_SET_UP,
    SIMULATION_CRASHED,
    RouteRecord,
    RunRecord,
)
from leaderboard.results import CARLA_FILE, read_run
from leaderboard.rules import CARLA_1_0
from leaderboard.runner import evaluate
from leaderboard.warm_up import SetupError

MISBEHAVING = Path(__file__).with_name("misbehaving.py")
TOY = load_suite("toy")
ROUTE, *OTHER_ROUTES = (spec.route_id for spec in TOY.specs())
QUIET = {"suite": "toy", "traffic": 0, "walkers": 0, "route_ids": (ROUTE,)}
BUSY = {"suite": "toy", "traffic": 8, "walkers": 4}


def misbehaving(name: str) -> RunSpec:
    return RunSpec(agent=f"{MISBEHAVING}:{name}", options=QUIET)


def driven(engine: Engine, spec: RunSpec, jobs: Sequence[Job]) -> list[RouteRecord]:
    return sorted(engine.run(spec, jobs), key=lambda record: record.index)


def evaluated(spec: RunSpec, seeds: Sequence[int], folder: Path, workers: int = 1) -> RunRecord:
    console = Console(file=io.StringIO())
    return evaluate(spec, seeds, suite=TOY, folder=folder, workers=workers, console=console)


def test_one_worker_two_workers_and_any_order_give_the_same_bits():
    spec = RunSpec(agent="random", options=BUSY)
    jobs = plan_jobs([ROUTE, *OTHER_ROUTES[:1]], [0, 1])
    one = [record.fingerprint() for record in driven(SerialEngine(), spec, jobs)]
    two = [record.fingerprint() for record in driven(PoolEngine(workers=2), spec, jobs)]
    turned = [record.fingerprint() for record in driven(SerialEngine(), spec, jobs[::-1])]
    assert one == two == turned
    assert len(set(one)) == len(jobs)


def test_another_seed_is_another_world_and_another_route_another_episode():
    spec = RunSpec(agent="constant", options={**BUSY, "route_ids": (ROUTE,)})
    first, second = driven(SerialEngine(), spec, plan_jobs([ROUTE], [0, 1]))
    assert first.observation_hash != second.observation_hash
    assert first.route_hash == second.route_hash


@pytest.mark.parametrize(
    ("agent", "status", "reason"),
    [
        ("Raises", AGENT_CRASHED, "KeyError: 'no such lane' at "),
        ("Exits", AGENT_CRASHED, "SystemExit: 3 at "),
        ("ReturnsNan", AGENT_CRASHED, "act returned steer NaN"),
        ("LeavesTheActionSpace", AGENT_CRASHED, "act returned throttle 1.5, outside [0, 1]"),
        ("ReturnsTheWrongShape", AGENT_CRASHED, "shape (2,), expected (3,)"),
        ("ReturnsText", AGENT_CRASHED, "ValueError: could not convert string to float"),
        ("FailsAtStart", NOT_SET_UP, "RuntimeError: no weights at "),
    ],
)
def test_a_misbehaving_agent_fails_its_route_with_the_reason(agent, status, reason):
    (record,) = driven(SerialEngine(), misbehaving(agent), plan_jobs([ROUTE], [0]))
    assert record.status == status
    assert reason in record.reason
    assert record.steps == (0 if status == NOT_SET_UP else 5)
    assert record.score.route_completion < 100.0
    assert record.length_m > 0.0


def test_the_run_goes_on_after_an_agent_has_crashed(tmp_path):
    run = evaluated(misbehaving("RaisesOnSeedTwo"), [1, 2, 3], tmp_path)
    assert [record.crashed for record in run.routes] == [False, True, False]
    assert run.complete
    assert json.loads((tmp_path / CARLA_FILE).read_text())["entry_status"] == (
        "Finished with agent errors"
    )


def test_an_agent_that_cannot_even_close_keeps_its_score_and_is_named():
    with pytest.warns(UserWarning, match="already closed"):
        (record,) = driven(SerialEngine(), misbehaving("FailsToClose"), plan_jobs([ROUTE], [0]))
    assert not record.crashed


def test_a_killed_worker_loses_its_own_route_and_no_other():
    jobs = plan_jobs([ROUTE], [1, 2, 3])
    records = driven(PoolEngine(workers=1), misbehaving("KillsItsWorker"), jobs)
    assert [record.crashed for record in records] == [False, True, False]
    assert records[1].status == SIMULATION_CRASHED
    assert records[1].reason == "the worker process was killed by SIGKILL"


@pytest.mark.parametrize(
    ("agent", "workers"),
    [("InterruptsTheRun", 1), ("InterruptsParentAndWorker", 2), ("TerminatesTheParent", 2)],
)
def test_what_was_finished_before_an_interruption_is_kept(agent, workers, tmp_path):
    run = evaluated(misbehaving(agent), [0, 1, 3, 2], tmp_path, workers)
    kept = {record.seed for record in run.routes}
    assert kept <= {0, 1, 3}
    assert len(kept) >= 4 - workers  # beside the one that interrupts, each other worker's own
    assert not run.complete
    assert read_run(tmp_path) == run
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_a_run_says_what_a_rerun_needs(tmp_path):
    run = evaluated(RunSpec(agent="constant", options=QUIET), [0], tmp_path)
    assert (run.suite, run.suite_version) == (TOY.name, TOY.version)
    assert run.cpu == cpu_capability()
    assert {"python", "driveinsight", "numpy", "numba"} <= run.versions.keys()
    assert run.track == "PROMPT"
    assert run.options["route_ids"] == [ROUTE]
    assert len(run.town_hash) >= 16
    assert sorted(os.listdir(tmp_path)) == ["driveinsight.json", "results.json", "routes"]


def test_events_carry_time_and_place():
    (record,) = driven(
        SerialEngine(), RunSpec(agent="constant", options=QUIET), plan_jobs([ROUTE], [0])
    )
    last = record.events[-1]
    assert record.status == CARLA_1_0.endings[last.kind]
    assert last.time_s == pytest.approx(last.tick * 0.05)
    assert record.game_s == pytest.approx(last.time_s, abs=0.1)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (RunSpec(agent="exprt", options=QUIET), "did you mean 'expert'"),
        (RunSpec(agent=f"{MISBEHAVING}:Nobody", options=QUIET), "no class 'Nobody'"),
        (RunSpec(agent="constant", options={**QUIET, "route_ids": ("nowhere",)}), "nowhere"),
    ],
)
def test_a_wrong_request_is_refused_before_anything_is_driven(spec, message, tmp_path):
    with pytest.raises(SetupError, match=message):
        evaluated(spec, [0], tmp_path)
    assert list(tmp_path.iterdir()) == []
