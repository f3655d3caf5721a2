"""A drive retraced: what the agent saw and remembered then, or a refusal that says why."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from agents import load_agent
from di_envs import restore, save
from leaderboard.records.packing import pack
from leaderboard.records.record import CHECK_TYPE, CONTROL_TYPE
from leaderboard.replaying.recorded_agent import RetraceError, retrace_env
from leaderboard.replaying.replay import ReplayError
from leaderboard.replaying.retracing import retrace
from tests.leaderboard.short_drives import short_run
from tests.leaderboard.untrained import save_untrained

DECISIONS = 30
BUSY = {"traffic": 8, "walkers": 4}


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    folder = tmp_path_factory.mktemp("policy")
    save_untrained(folder, "driveinsight-told")
    return folder


@pytest.fixture(scope="module")
def run(weights):
    return short_run(f"driveinsight:{weights}", DECISIONS, **BUSY)


def test_every_decision_is_made_again_from_what_was_seen_and_remembered(run):
    record = run.routes[0]
    agent = load_agent(run.agent)
    decisions = list(retrace(run, record))
    assert [decision.number for decision in decisions] == list(range(record.steps + 1))
    for decision, control in zip(decisions[:-1], record.control_array(), strict=True):
        assert np.array_equal(agent.act(decision.seen, decision.memory)[0], control)
        assert np.array_equal(decision.control, control)
        assert decision.time_s == pytest.approx(decision.number * 0.1)
    assert decisions[-1].control is None
    assert decisions[-1].time_s == record.game_s == DECISIONS * 0.1


@pytest.mark.parametrize("agent", ["expert", "random", "highway"])
def test_other_agents_are_retraced_too(agent):
    run = short_run(agent, DECISIONS, **BUSY)
    assert sum(1 for _ in retrace(run, run.routes[0])) == DECISIONS + 1


def test_the_agent_is_shown_the_edited_observation_and_no_camera_that_it_lacks(weights):
    edits = ("set:speed=3", "noise:map,sigma=0.5@t>1")
    run = short_run(f"driveinsight:{weights}", DECISIONS, interventions=edits, **BUSY)
    env = retrace_env(run, front=True)
    for decision in retrace(run, run.routes[0], env=env):
        assert decision.seen["speed"] == 3.0
        assert "camera_front" not in decision.seen
        assert decision.step.observation["camera_front"].shape == (144, 256, 3)
        changed = not np.array_equal(decision.seen["map"], decision.step.observation["map"])
        assert changed == (decision.time_s > 1.0)


def test_the_caller_may_drive_elsewhere_between_two_decisions_and_come_back(run):
    env = retrace_env(run)
    for decision in retrace(run, run.routes[0], env=env):
        if decision.number == 10:
            here = save(env)
            for _ in range(5):
                env.step(np.array([1.0, 0.5, 0.0], np.float32))
            restore(env, here)
    assert decision.number == DECISIONS


def test_other_weights_are_noticed_at_the_first_other_decision_and_named(run, weights, tmp_path):
    save_untrained(tmp_path, "driveinsight-told", seed=1)
    other = dataclasses.replace(run, agent=f"driveinsight:{tmp_path}")
    with pytest.raises(RetraceError, match=r"at 0(\.1)? s the agent acts otherwise.*the weights"):
        list(retrace(other, run.routes[0]))
    gone = dataclasses.replace(run, agent=f"driveinsight:{tmp_path / 'gone'}")
    with pytest.raises(
        RetraceError, match=r"is not to be had here: .*config\.json: cannot be read"
    ):
        list(retrace(gone, run.routes[0]))


def test_what_an_edit_remembers_is_a_value_of_the_eyes(weights):
    run = short_run(f"driveinsight:{weights}", 12, interventions=("delay:speed,steps=5",), **BUSY)
    speeds, again = [], []
    for decision in retrace(run, run.routes[0]):
        speeds.append(float(decision.step.observation["speed"][0]))
        for _ in range(2):  # looking once more changes nothing
            seen, _eyes = decision.eyes.look(decision.step.observation, decision.context)
            assert seen["speed"] == decision.seen["speed"]
        again.append(float(decision.seen["speed"][0]))
    assert again[5:] == speeds[:-5]


def test_another_control_or_another_look_is_noticed_where_it_is(run):
    record = run.routes[0]
    controls = record.control_array().copy()
    controls[7, 1] = np.nextafter(controls[7, 1], np.float32(2.0))
    altered = dataclasses.replace(record, controls=pack(controls, CONTROL_TYPE))
    with pytest.raises(RetraceError, match=r"at 0\.7 s the agent acts otherwise.*CPU are not"):
        list(retrace(run, altered))
    checks = record.check_array().copy()
    checks[3] += 1
    altered = dataclasses.replace(record, observation_checks=pack(checks[:, None], CHECK_TYPE))
    with pytest.raises(RetraceError, match=r"at 0\.3 s the agent would see.*verify --observations"):
        list(retrace(run, altered))
    cut = dataclasses.replace(record, observation_checks=pack(checks[:5, None], CHECK_TYPE))
    with pytest.raises(ReplayError, match="5 hashes of observations for"):
        list(retrace(run, cut))
