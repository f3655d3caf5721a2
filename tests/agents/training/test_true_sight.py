"""A policy that is lent eyes: what truly is in sight goes in, and nothing is rendered."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import di_envs
from agents import load_agent
from agents.base import Track
from agents.training.caching import truly_seen
from tests.agents.explain.small_policy import save_policy


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return save_policy(tmp_path_factory.mktemp("policy"))


@pytest.fixture(scope="module")
def moment(folder):
    """An agent with perfect eyes, and what it is shown a second into a drive among others."""
    agent = load_agent(f"true-sight:{folder}")
    env = di_envs.RouteEnv(suite="toy", observations=agent.requires.observations, traffic=20)
    observation, _ = env.reset(seed=1)
    for _ in range(10):
        observation, *_ = env.step(np.array([0.5, 0.0, 0.0], np.float32))
    return agent, {**observation, "world": env.view}, agent.start(env.plan, 1)


def test_it_is_privileged_and_needs_no_sensor(moment):
    agent, *_ = moment
    assert agent.requires.track is Track.PRIVILEGED
    assert agent.requires.observations == ("prompt",)
    assert agent.requires.options == {}


def test_its_policy_is_handed_what_truly_is_in_sight(moment):
    agent, observation, memory = moment
    objects, signals = truly_seen(observation["world"], agent.policy.config.grid)
    inputs = agent._inputs(observation, memory)
    assert np.array_equal(inputs.seen.objects[0].numpy(), objects)
    assert np.array_equal(inputs.seen.signals[0].numpy(), signals)
    assert (objects[:, -1] > 0.0).any()
    there = np.hypot(*objects[objects[:, -1] > 0.0][:, :2].T)
    assert (np.diff(there) >= 0.0).all()  # the nearest first


def test_it_decides_the_same_twice_and_otherwise_with_blurred_eyes(moment, folder):
    agent, observation, memory = moment
    first, again = (agent.act(observation, memory)[0] for _ in range(2))
    assert np.array_equal(first, again)
    blurred = load_agent(f"true-sight:{folder}?eyes=blurred")
    perfect = agent._inputs(observation, memory).seen.objects
    later = [dataclasses.replace(memory, decision=decision) for decision in range(8)]
    seen = [blurred._inputs(observation, each).seen.objects for each in later]
    assert any(not np.array_equal(each, perfect) for each in seen)  # now and then they see well
    assert np.array_equal(seen[3], blurred._inputs(observation, later[3]).seen.objects)


def test_other_eyes_are_refused_with_those_there_are(folder):
    with pytest.raises(ValueError, match="did you mean 'blurred'"):
        load_agent(f"true-sight:{folder}?eyes=blured")
