"""The agent `driveinsight`: its memory is a value, so a drive can be branched and gone on with."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import di_envs
from agents import AgentSpecError, load_agent
from agents.base import Track
from agents.driveinsight.config import (
    CameraEncoderConfig,
    FusionConfig,
    PlannerConfig,
    PolicyConfig,
)
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import save_pretrained
from agents.networks.grid import GridConfig
from tests.agents.driveinsight.random_inputs import awake

CONFIG = PolicyConfig(
    name="test",
    grid=GridConfig(cells=24),
    camera=CameraEncoderConfig(rig="rl", width=4, stride=4, channels=4, depth_bins=4),
    lidar=None,
    planner=PlannerConfig(width=16, heads=2, layers=1),
    memory_frames=2,
    fusion=FusionConfig(width=4, remembered=4, widths=(4, 4)),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    torch.manual_seed(3)
    path = tmp_path_factory.mktemp("policy")
    save_pretrained(awake(Policy(CONFIG)), path, "a card")
    return path


@pytest.fixture(scope="module")
def agent(folder):
    return load_agent(f"driveinsight:{folder}")


def new_env(agent):
    needs = agent.requires
    return di_envs.RouteEnv(suite="toy", observations=needs.observations, **needs.options)


def drive(env, agent, observation, memory, steps):
    controls = []
    for _ in range(steps):
        control, memory = agent.act(observation, memory)
        controls.append(control)
        observation, *_ = env.step(control)
    return controls, observation, memory


def test_its_needs_are_those_of_its_configuration(agent):
    assert agent.requires.observations == ("camera", "prompt", "odometry")
    assert agent.requires.options == {"cameras": "rl"}
    assert agent.requires.track is Track.SENSORS


def test_a_drive_taken_up_again_goes_the_same_way_to_the_bit(agent, folder):
    env = new_env(agent)
    observation, _ = env.reset(seed=1)
    _, observation, memory = drive(env, agent, observation, agent.start(env.plan, 1), 12)
    snapshot = di_envs.save(env)
    first, *_ = drive(env, agent, observation, memory, 8)
    di_envs.restore(env, snapshot)
    again, *_ = drive(env, load_agent(f"driveinsight:{folder}"), observation, memory, 8)
    assert np.array_equal(first, again)


def test_what_it_remembers_makes_a_difference(agent):
    env = new_env(agent)
    observation, _ = env.reset(seed=1)
    _, observation, memory = drive(env, agent, observation, agent.start(env.plan, 1), 12)
    with_memory, _ = agent.act(observation, memory)
    without, _ = agent.act(observation, agent.start(env.plan, 1))
    assert not np.array_equal(with_memory, without)


def test_it_remembers_moments_half_a_second_and_a_second_old(agent):
    env = new_env(agent)
    observation, _ = env.reset(seed=1)
    _, _, memory = drive(env, agent, observation, agent.start(env.plan, 1), 14)
    assert len(memory.frames) == 10  # two frames back at 0.5 s, of decisions at 0.1 s
    bank = agent._bank(memory.frames)
    # before the next decision the newest frame is 0.1 s old: the fifth is 0.5 s, the tenth 1 s
    assert torch.equal(bank.poses[0, 0], memory.frames[4][1][0])
    assert torch.equal(bank.poses[0, 1], memory.frames[9][1][0])
    assert bank.valid.all()


def test_deciding_leaves_torchs_threads_as_they_were(agent):
    env = new_env(agent)
    observation, _ = env.reset(seed=1)
    memory = agent.start(env.plan, 1)
    torch.set_num_threads(2)
    control, _ = agent.act(observation, memory)
    assert torch.get_num_threads() == 2
    torch.set_num_threads(1)
    assert np.array_equal(control, agent.act(observation, memory)[0])


def test_the_folder_may_be_named_as_an_option_too(folder):
    agent = load_agent("agents.driveinsight.agent:DriveInsightAgent", weights=str(folder))
    assert agent.requires.options == {"cameras": "rl"}


def test_a_folder_without_a_policy_is_refused_with_what_to_do(tmp_path):
    with pytest.raises(AgentSpecError, match="that `driveinsight train` wrote"):
        load_agent(f"driveinsight:{tmp_path}")
