"""A replay without the policy goes through the same states, with the same events and end."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
import pytest
from rich.console import Console

import di_envs
from di_envs.suites import load_suite
from leaderboard.records.results import read_run
from leaderboard.replaying.replay import ReplayError, replay, replay_env, replay_to
from leaderboard.running.jobs import RunSpec
from leaderboard.running.runner import evaluate

TOY = load_suite("toy")
ROUTE = TOY.specs()[0].route_id
BUSY = {"suite": "toy", "traffic": 8, "walkers": 4, "route_ids": (ROUTE,)}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A drive into the traffic: collisions, a red light, lanes left."""
    folder = tmp_path_factory.mktemp("run")
    spec = RunSpec(agent="random", options=BUSY)
    evaluate(spec, [0, 1], suite=TOY, folder=folder, console=Console(file=io.StringIO()))
    return read_run(folder)


def test_a_replay_has_the_recorded_events_trace_and_end(run):
    env = replay_env(run)
    for record in run.routes:
        steps = 0
        events = []
        for step in replay(run, record, env=env):
            steps = step.decision
            events += [(event.kind, event.tick, event.x, event.value) for event in step.events]
        assert steps == record.steps
        assert step.over
        assert events == [(e.kind, e.tick, e.x, e.value) for e in record.events]
        assert step.info["route_completion"] == pytest.approx(record.score.route_completion)
        state = step.view.state
        end = [float(values[0]) for values in (state.x, state.y, state.z, state.yaw, state.speed)]
        assert record.trace[-1] == pytest.approx([record.game_s, *end], abs=5e-4)


def test_the_moment_of_a_record_can_be_driven_on_from(run):
    record = run.routes[0]
    env = replay_to(run, record, 3.0)
    assert int(env.view.state.tick) == 60
    snapshot = di_envs.save(env)
    for control in record.control_array()[30:]:
        *_, terminated, truncated, _ = env.step(control)
    assert terminated or truncated
    first = env.view.state.x.copy()
    di_envs.restore(env, snapshot)
    for control in record.control_array()[30:]:
        env.step(control)
    assert np.array_equal(env.view.state.x, first)


def test_a_moment_after_the_end_is_refused(run):
    with pytest.raises(ReplayError, match="there is no moment 1000"):
        replay_to(run, run.routes[0], 1000.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"route_hash": "00"}, "is not the recorded one"),
        ({"world_seed": 5}, "the record says 5"),
        ({"route_id": "nowhere"}, "gives the world"),
        ({"steps": 3}, "controls for 3 decisions"),
        ({"controls": "!!"}, "cannot be read"),
    ],
)
def test_what_is_not_the_recorded_route_is_refused(run, change, message):
    record = dataclasses.replace(run.routes[0], **change)
    with pytest.raises(ReplayError, match=message):
        list(replay(run, record))


def test_controls_beyond_the_routes_end_are_refused(run):
    from leaderboard.records.packing import pack

    record = run.routes[0]
    controls = np.concatenate([record.control_array(), np.zeros((2, 3), np.float32)])
    longer = dataclasses.replace(record, controls=pack(controls, "<f4"), steps=record.steps + 2)
    with pytest.raises(ReplayError, match="the record goes on to"):
        list(replay(run, longer))


def test_another_town_is_refused(run):
    with pytest.raises(ReplayError, match="the same map and signals"):
        replay_env(dataclasses.replace(run, town_hash="00"))
