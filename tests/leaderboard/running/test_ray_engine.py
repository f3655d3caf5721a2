"""Runs on a Ray cluster of this machine: the same bits as here, whatever happens to workers."""

from __future__ import annotations

import dataclasses
import importlib.util
import io
import os
import shutil
import signal
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from di_envs.suites import load_suite
from leaderboard.commands.cli import main
from leaderboard.commands.ending import EXIT_USAGE
from leaderboard.records.record import RunRecord
from leaderboard.running.driver import Driver
from leaderboard.running.jobs import RunSpec, SetupError, plan_jobs
from leaderboard.running.messages import Driven, RunFacts
from leaderboard.running.runner import evaluate
from leaderboard.running.setting_up import run_facts, set_up
from leaderboard.running.wall_clock import Stopwatch
from leaderboard.running.workers.local_engine import Engine
from leaderboard.running.workers.ray_engine import RayEngine, check_footing
from leaderboard.studies.study_file import read_study

MISBEHAVING = Path(__file__).parents[1] / "misbehaving.py"
FOLLOWER = f"{Path(__file__).parents[3] / 'examples' / 'your_own_agent.py'}:RouteFollower"
TOY = load_suite("toy")
ROUTE = TOY.specs()[0].route_id
OPTIONS = {"suite": "toy", "traffic": 8, "walkers": 4, "route_ids": (ROUTE,)}
# Ray's own warnings are not ours; starting a cluster takes ten seconds
on_a_cluster = (
    pytest.mark.skipif(
        importlib.util.find_spec("ray") is None, reason="Ray is not installed: driveinsight[ray]"
    ),
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore"),
)


def cluster(function):
    for mark in on_a_cluster:
        function = mark(function)
    return function


def evaluated(
    spec: RunSpec, seeds: list[int], folder: Path, said: io.StringIO, engine: Engine | None = None
) -> RunRecord:
    return evaluate(
        spec,
        seeds,
        suite=TOY,
        folder=folder,
        engine=engine or RayEngine(workers=2),
        console=Console(file=said, width=200),
    )


@cluster
def test_the_bits_are_those_of_this_process_though_an_actor_dies(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(MISBEHAVING, "mine.py")  # named as in this folder, it is found from any other
    spec = RunSpec(agent="mine.py:KillsItsParentThenItself", options=OPTIONS, isolate=False)
    said = io.StringIO()
    run = evaluated(spec, [0, 1, 2, 3], tmp_path / "run", said)
    assert f"route {ROUTE}, seed 2: Failed - Worker died, tried again: the Ray " in said.getvalue()
    assert run.complete
    with Driver(spec) as driver:
        here = [driver.drive(job).fingerprint() for job in plan_jobs([ROUTE], [0, 1, 2, 3])]
    assert [record.fingerprint() for record in run.routes] == here


@dataclass
class LosesItsMachine:
    """Ray whose only machine that drives goes after two routes, and another comes."""

    machines: Any
    driving: Any

    def run(self, spec, jobs):
        driven = 0
        for event in RayEngine(address=self.machines.address).run(spec, jobs):
            yield event
            driven += isinstance(event, Driven)
            if driven == 2 and self.driving is not None:
                self.machines.remove_node(self.driving, allow_graceful=False)
                self.driving = None
                self.machines.add_node(num_cpus=1)


@cluster
def test_the_bits_are_those_of_this_process_though_a_machine_is_lost(tmp_path):
    from ray.cluster_utils import Cluster

    spec = RunSpec(agent="constant", options=OPTIONS)
    handler = signal.getsignal(signal.SIGTERM)  # a machine made here puts its own in its place
    machines = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
    try:
        engine = LosesItsMachine(machines, machines.add_node(num_cpus=1))
        said = io.StringIO()
        run = evaluated(spec, [0, 1, 2, 3], tmp_path / "run", said, engine)
    finally:
        machines.shutdown()
        signal.signal(signal.SIGTERM, handler)
    assert "Failed - Worker died, tried again: the Ray worker is gone" in said.getvalue()
    assert run.complete
    with Driver(spec) as driver:
        here = [driver.drive(job).fingerprint() for job in plan_jobs([ROUTE], [0, 1, 2, 3])]
    assert [record.fingerprint() for record in run.routes] == here


class InterruptsWhenToldOf(io.StringIO):
    """A person who presses Ctrl-C when a certain line comes up."""

    def __init__(self, line: str) -> None:
        super().__init__()
        self._line, self._pressed = line, False

    def write(self, text: str) -> int:
        if self._line in text and not self._pressed:
            self._pressed = True
            os.kill(os.getpid(), signal.SIGINT)
        return super().write(text)


@cluster
def test_ctrl_c_keeps_what_is_finished(tmp_path):
    spec = RunSpec(agent=f"{MISBEHAVING}:RaisesOnSeedTwo", options=OPTIONS)
    said = InterruptsWhenToldOf("seed 2: Failed - Agent crashed")
    run = evaluated(spec, [2, *range(10, 40)], tmp_path / "run", said)
    assert 1 <= len(run.routes) < run.planned == 31
    assert "interrupted: " in said.getvalue()


@cluster
def test_a_study_starts_one_cluster_for_all_its_rows(tmp_path, monkeypatch):
    import ray

    start, starts = ray.init, []
    monkeypatch.setattr(ray, "init", lambda **options: (starts.append(options), start(**options)))
    study = ["ablate", "--agent", FOLLOWER, "--suite", "toy", "--traffic", "8", "--walkers", "4"]
    study += ["--route-ids", ROUTE, "--rows", "zero-routing", "--engine", "ray"]
    assert main([*study, "--output", str(tmp_path)]) == 0
    assert len(starts) == 1
    before, null, edited = (driven.drives[0].episode for driven in read_study(tmp_path).rows)
    assert before == null != edited


@pytest.fixture(scope="module")
def scene() -> RunFacts:
    with set_up(RunSpec(agent="constant", options=OPTIONS), Stopwatch()) as driver:
        return run_facts(driver)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"cpu": "z80"}, r"differ \(the CPU's capability .*, not z80"),
        ({"versions": {"numpy": "1.0"}}, r"differ \(versions 'numpy' .*, not 1\.0"),
        ({"agent_version": "00"}, r"differ \(the agent's version constant 1, not 00"),
    ],
)
def test_a_machine_that_would_give_other_bits_is_refused(scene, fields, message):
    check_footing(scene, scene)
    more = {**scene.versions, "torch": "1.0"}  # installed there; the agent has not loaded it
    check_footing(scene, dataclasses.replace(scene, versions=more))
    with pytest.raises(SetupError, match=message):
        check_footing(scene, dataclasses.replace(scene, **fields))


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    run = ["evaluate", "--agent", "constant", "--suite", "toy", *arguments]
    assert main(run) == EXIT_USAGE
    return capsys.readouterr().err


def test_without_ray_the_error_says_what_to_install(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(sys.modules, "ray", None)
    arguments = ["--engine", "ray", "--output", str(tmp_path / "run")]
    assert "pip install 'driveinsight[ray]'" in refused(arguments, capsys)
    assert not (tmp_path / "run").exists()


def test_an_address_needs_the_engine_that_it_is_of(capsys):
    assert "--engine ray" in refused(["--address", "auto"], capsys)
