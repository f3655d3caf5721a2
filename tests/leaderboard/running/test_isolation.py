"""Agents of others drive in a process of their own, to the same bits, and reach nothing else."""

from __future__ import annotations

import random
import signal
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path

import numpy as np
import pytest

from agents.base import Requirements
from agents.faults import AgentFaultError
from agents.generators import generators
from agents.isolated import AgentProcess, IsolatedAgent
from di_envs.suites import load_suite
from leaderboard.records.record import AGENT_CRASHED
from leaderboard.running.driver import Driver
from leaderboard.running.jobs import RunSpec, SetupError, plan_jobs
from leaderboard.running.setting_up import set_up
from leaderboard.running.wall_clock import Stopwatch
from tests.leaderboard.running.test_runner import evaluated

MISBEHAVING = Path(__file__).parents[1] / "misbehaving.py"
ROUTE = load_suite("toy").specs()[0].route_id
QUIET = {"suite": "toy", "traffic": 0, "walkers": 0, "route_ids": (ROUTE,)}


def spec_of(agent, *, isolate=True, **options):
    return RunSpec(agent=f"{MISBEHAVING}:{agent}", options={**QUIET, **options}, isolate=isolate)


def driven(spec, seeds=(0,)):
    with Driver(spec) as driver:
        return [driver.drive(job) for job in plan_jobs(driver.env.route_ids, seeds)]


def test_what_an_agent_may_not_know_is_not_in_its_process():
    (inside,) = driven(spec_of("LooksAround", isolate=False))
    assert inside.done_m < 1.0  # it found the world, and braked
    (apart,) = driven(spec_of("LooksAround"))
    assert apart.done_m > 10.0


def test_a_process_says_which_packages_its_agent_has_loaded(tmp_path):
    mine = tmp_path / "mine.py"
    mine.write_text("import highway_env\nfrom agents.constant import ConstantAgent as Mine\n")
    process = AgentProcess()
    try:
        assert IsolatedAgent(process, "constant").loaded() == ()
        assert IsolatedAgent(process, f"{mine}:Mine").loaded() == ("highway-env",)
    finally:
        process.stop()


@pytest.mark.parametrize("agent", ["SeesTheCamera", "DrawsFromAll"])
def test_the_bits_are_the_same_in_this_process_and_in_one_of_its_own(agent):
    if agent == "DrawsFromAll":
        pytest.importorskip("torch")
    apart, again = driven(spec_of(agent), [0, 1]), driven(spec_of(agent), [1])
    here = driven(spec_of(agent, isolate=False), [0, 1])
    assert not any(record.crashed for record in here)
    assert [r.fingerprint() for r in apart] == [r.fingerprint() for r in here]
    # and whatever was driven before
    assert again[0].controls == here[1].controls != here[0].controls
    assert again[0].observation_hash == here[1].observation_hash


@pytest.mark.parametrize("isolate", [True, False])
@pytest.mark.parametrize(
    ("agent", "reason"),
    [
        ("InterruptsItself", "KeyboardInterrupt at "),
        ("LeavesAGenerator", "GeneratorExit at "),
        ("RaisesItsOwnBase", "OwnBaseError: mine at "),
        ("RaisesWhatCannotBeSaid", "UnspeakableError: (its text cannot be had: RuntimeError) at "),
        ("SaysFarTooMuch", r"ValueError: \x1b[2Jxxx"),
    ],
)
def test_whatever_act_raises_counts_as_driving(agent, reason, isolate, without_ctrl_c):
    (record,) = driven(spec_of(agent, isolate=isolate))
    assert record.status == AGENT_CRASHED
    assert record.reason.startswith(reason)
    assert len(record.reason) < 1000
    assert (record.steps, record.lost) == (5, False)


@pytest.fixture
def without_ctrl_c():
    """As in a worker: Ctrl-C is its parent's."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("isolate", [True, False])
def test_a_forked_childs_drive_is_not_taken(isolate, tmp_path):
    run = evaluated(spec_of("Forks", isolate=isolate), [0, 1], tmp_path)
    assert [record.lost or record.crashed for record in run.routes] == [False, False]
    assert run.routes[0].steps > 5


def test_every_route_begins_in_the_folder_that_the_run_began_in():
    for isolate in (True, False):
        here = Path.cwd()
        first, second = driven(spec_of("WandersOff", isolate=isolate), [0, 1])
        assert Path.cwd() == here
        for record in (first, second):
            assert not record.control_array()[:, 1].any()


def test_an_agent_that_closes_its_output_drives_on(capfd):
    (record,) = driven(spec_of("ClosesStdout"))
    assert not record.crashed
    assert record.steps > 6
    print("still here")
    assert "still here" in capfd.readouterr().out


@pytest.mark.parametrize("isolate", [True, False])
def test_an_agent_cannot_choose_its_own_benchmark(isolate):
    spec = replace(spec_of("ChoosesItsRoutes", isolate=isolate), options={"suite": "toy"})
    with pytest.raises(SetupError, match="an agent may not ask for 'traffic'"):
        set_up(spec, Stopwatch())


@pytest.mark.parametrize(
    "option", ["routes", "town", "signals", "scenarios", "walkers", "route_ids", "terminate_on"]
)
def test_requirements_name_what_an_agent_may_not_ask_for(option):
    with pytest.raises(ValueError, match=f"'{option}'.*cameras, lidar"):
        Requirements(options={option: "mine"})


def test_an_agent_gets_what_its_run_says_and_not_what_it_says_later():
    with Driver(spec_of("BecomesPrivileged", isolate=False)) as driver:
        record = driver.drive(plan_jobs(driver.env.route_ids, [0])[0])
    assert not driver.requires.privileged
    assert record.done_m < 1.0  # it was not shown the world


def test_a_privileged_agent_of_ones_own_drives_beside_the_world(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "from agents.expert.agent import Expert\n\n\nclass Mine(Expert):\n    pass\n",
    )
    spec = RunSpec(agent=f"{path}:Mine", options=QUIET)
    (own,) = driven(spec)
    (ours,) = driven(RunSpec(agent="expert", options=QUIET))
    assert own.fingerprint() == ours.fingerprint()


def test_answers_of_an_agents_process_are_read_as_text_and_never_run():
    process = AgentProcess()
    try:
        agent = IsolatedAgent(process, f"{MISBEHAVING}:Brakes")
        assert agent.requires == Requirements()
        process._connection.close()
        ours, theirs = Pipe()
        process._connection = ours
        theirs.send(print)  # a pickle
        with pytest.raises(AgentFaultError, match="no answer"):
            process.ask("requires")
        assert process.id == 0  # what it answers later is no answer to another question
    finally:
        process.stop()


def drawn_by_all():
    return random.random(), np.random.random()  # noqa: NPY002


def test_generators_are_put_back_for_the_caller():
    states = random.getstate(), np.random.get_state()  # noqa: NPY002
    expected = drawn_by_all()
    random.setstate(states[0])
    np.random.set_state(states[1])  # noqa: NPY002
    with generators() as drawn:
        drawn.begin(3)
        first = drawn_by_all()
        drawn.begin(3)
        assert drawn_by_all() == first
    assert drawn_by_all() == expected
