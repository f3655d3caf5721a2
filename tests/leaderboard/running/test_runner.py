"""Runs on the toy town: the same bits however they are run, and no agent can stop them."""

from __future__ import annotations

import io
import json
import os
import shutil
import signal
from collections import deque
from collections.abc import Sequence
from pathlib import Path

import pytest
from rich.console import Console

from di_envs.numerics.kernels import cpu_capability
from di_envs.rules import CARLA_1_0
from di_envs.suites import load_suite
from leaderboard.records.record import (
    AGENT_CRASHED,
    NOT_SET_UP,
    OUT_OF_TIME,
    WORKER_DIED,
    RouteRecord,
    RunRecord,
)
from leaderboard.records.results import CARLA_FILE, read_run
from leaderboard.running.driver import Driver
from leaderboard.running.jobs import RunSpec, SetupError, plan_jobs
from leaderboard.running.messages import Lost
from leaderboard.running.runner import evaluate
from leaderboard.running.wall_clock import Limits
from leaderboard.running.workers.local_engine import LocalEngine

MISBEHAVING = Path(__file__).parents[1] / "misbehaving.py"
TOY = load_suite("toy")
ROUTE, *OTHER_ROUTES = (spec.route_id for spec in TOY.specs())
QUIET = {"suite": "toy", "traffic": 0, "walkers": 0, "route_ids": (ROUTE,)}
BUSY = {"suite": "toy", "traffic": 8, "walkers": 4, "route_ids": (ROUTE, OTHER_ROUTES[0])}
SHORT = Limits(step_s=2.0, setup_s=60.0)


def misbehaving(name: str, *, isolate: bool = True) -> RunSpec:
    return RunSpec(agent=f"{MISBEHAVING}:{name}", options=QUIET, isolate=isolate)


def driven(spec: RunSpec, seeds: Sequence[int] = (0,)) -> list[RouteRecord]:
    """Routes driven in this process."""
    with Driver(spec) as driver:
        return [driver.drive(job) for job in plan_jobs(driver.env.route_ids, seeds)]


def evaluated(
    spec: RunSpec,
    seeds: Sequence[int],
    folder: Path,
    *,
    workers: int = 1,
    limits: Limits = SHORT,
    said: io.StringIO | None = None,
) -> RunRecord:
    return evaluate(
        spec,
        seeds,
        suite=TOY,
        folder=folder,
        engine=LocalEngine(workers=workers, limits=limits),
        console=Console(file=said or io.StringIO(), width=200),
    )


def test_in_this_process_in_one_worker_and_in_two_the_bits_are_the_same(tmp_path):
    spec = RunSpec(agent="random", options=BUSY)
    here = [record.fingerprint() for record in driven(spec, [0, 1])]
    for workers in (1, 2):
        run = evaluated(spec, [0, 1], tmp_path / str(workers), workers=workers)
        assert [record.fingerprint() for record in run.routes] == here
    assert len(set(here)) == 4


def test_another_seed_is_another_world_and_another_route_another_episode():
    first, second = driven(RunSpec(agent="constant", options={**BUSY, **QUIET}), [0, 1])
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
        ("ReturnsNone", AGENT_CRASHED, "TypeError: cannot unpack non-iterable NoneType"),
        ("FailsAtStart", NOT_SET_UP, "RuntimeError: no weights at "),
    ],
)
def test_a_misbehaving_agent_fails_its_route_with_the_reason(agent, status, reason):
    (record,) = driven(misbehaving(agent))
    assert record.status == status
    assert reason in record.reason
    assert record.steps == (0 if agent in ("FailsAtStart", "ReturnsNone") else 5)
    assert record.score.route_completion < 100.0
    assert record.length_m > 0.0
    assert not record.lost


def test_the_run_goes_on_after_an_agent_has_crashed(tmp_path):
    run = evaluated(misbehaving("RaisesOnSeedTwo"), [1, 2, 3], tmp_path)
    assert [record.crashed for record in run.routes] == [False, True, False]
    assert run.complete
    assert json.loads((tmp_path / CARLA_FILE).read_text())["entry_status"] == (
        "Finished with agent errors"
    )


def test_an_agent_that_cannot_even_close_keeps_its_score_and_is_named(tmp_path):
    with pytest.warns(UserWarning, match="already closed"):
        run = evaluated(misbehaving("FailsToClose"), [0], tmp_path)
    assert not run.routes[0].crashed


@pytest.mark.parametrize(
    ("agent", "status", "reason"),
    [
        ("EndsItsProcess", WORKER_DIED, "the agent's process ended by itself with exit code 7"),
        ("Segfaults", WORKER_DIED, "the agent's process was killed by SIGSEGV"),
        ("Sleeps", OUT_OF_TIME, "a step of the agent took more than 2 s (in misbehave at "),
        ("SleepsWithPythonsLock", OUT_OF_TIME, "a step of the agent took more than 2 s"),
    ],
)
def test_an_agent_that_takes_its_worker_along_is_tried_twice_and_left_out(
    agent, status, reason, tmp_path, capfd
):
    said = io.StringIO()
    run = evaluated(misbehaving(agent), [0], tmp_path, said=said)
    (record,) = run.routes
    assert (record.status, record.lost, run.complete) == (status, True, True)
    assert reason in record.reason
    assert f"seed 0: {status}, tried again: " in said.getvalue()
    assert f"seed 0: {status}: left out of the means: " in said.getvalue()
    assert read_run(tmp_path) == run
    assert ("Segmentation fault" in capfd.readouterr().err) == (agent == "Segfaults")


@pytest.mark.parametrize(
    ("agent", "limits", "reason"),
    [
        ("SleepsAtStart", Limits(setup_s=10.0), "setting up the agent took more than 10 s (in st"),
        ("Dawdles", Limits(route_s=1.0), "the route took more than 1 s of wall-clock time (in act"),
    ],
)
def test_an_agent_that_never_starts_or_never_ends_is_stopped(agent, limits, reason):
    """As the engine tells it: here nobody tries again."""
    events = LocalEngine(limits=limits).run(misbehaving(agent), deque(plan_jobs([ROUTE], [0])))
    (lost,) = [event for event in events if isinstance(event, Lost)]
    assert lost.status == OUT_OF_TIME
    assert lost.reason.startswith(reason)


def test_a_worker_that_is_always_killed_loses_its_own_route_and_no_other(tmp_path):
    run = evaluated(misbehaving("KillsItsWorker"), [1, 2, 3], tmp_path)
    assert [record.lost for record in run.routes] == [False, True, False]
    assert run.routes[1].reason == "the agent's process was killed by SIGKILL"
    assert json.loads((tmp_path / CARLA_FILE).read_text())["eligible"] is False


def test_a_worker_killed_once_costs_nothing(tmp_path):
    agents = shutil.copy(MISBEHAVING, tmp_path)  # it leaves a file beside it
    spec = RunSpec(agent=f"{agents}:KillsItsWorkerOnce", options=QUIET)
    run = evaluated(spec, [1, 2, 3], tmp_path / "run")
    assert [record.lost for record in run.routes] == [False, False, False]
    here = [record.fingerprint() for record in driven(spec, [1, 2, 3])]
    assert [record.fingerprint() for record in run.routes] == here


@pytest.mark.parametrize(
    ("agent", "workers"),
    [("InterruptsTheRun", 1), ("InterruptsTheRun", 2), ("TerminatesTheRun", 2)],
)
def test_what_was_finished_before_an_interruption_is_kept(agent, workers, tmp_path):
    spec = misbehaving(agent, isolate=False)  # there it knows who runs the run
    run = evaluated(spec, [0, 1, 3, 2], tmp_path, workers=workers)
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
    assert {"python", "driveinsight", "world", "numpy", "numba"} <= run.versions.keys()
    assert run.track == "PROMPT"
    assert run.options["route_ids"] == [ROUTE]
    assert all(len(text) >= 16 for text in (run.town_hash, run.routes_hash))
    assert run.agent_version == "constant 1"
    assert sorted(os.listdir(tmp_path)) == ["driveinsight.json", "results.json", "routes"]


def test_events_carry_time_and_place():
    (record,) = driven(RunSpec(agent="constant", options=QUIET))
    last = record.events[-1]
    assert record.status == CARLA_1_0.endings[last.kind]
    assert last.time_s == pytest.approx(last.tick * 0.05)
    assert record.game_s == pytest.approx(last.time_s, abs=0.1)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (RunSpec(agent="exprt", options=QUIET), "did you mean 'expert'"),
        (misbehaving("Nobody"), "no class 'Nobody'"),
        (misbehaving("RaisesWhenMade"), "cannot be made: OSError: no weights at "),
        (
            misbehaving("EndsItsProcessWhenMade"),
            "cannot be made: the agent's process ended by itself with exit code 7",
        ),
        (misbehaving("SleepsWhenMade"), r"setting up the agent took more than 10 s \(in __init__"),
        (RunSpec(agent="constant", options={**QUIET, "route_ids": ("nowhere",)}), "nowhere"),
    ],
)
def test_a_wrong_request_is_refused_before_anything_is_driven(spec, message, tmp_path):
    with pytest.raises(SetupError, match=message):
        evaluated(spec, [0], tmp_path, limits=Limits(setup_s=10.0))
    assert list(tmp_path.iterdir()) == []
