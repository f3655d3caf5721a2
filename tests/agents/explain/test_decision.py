"""What is seen of a decision of the DriveInsight policy: of the very decision that was driven."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from agents.driveinsight.config import TOKENS, PolicyConfig
from agents.explain.activation import activation_maps
from agents.explain.look import look_at
from agents.explain.responses import responses_at, token_gradients
from di_envs.edits.text import read_edits
from tests.agents.explain.small_policy import CONFIG, agent_of, moment_of, save_policy


@pytest.fixture(scope="module")
def agent(tmp_path_factory):
    return agent_of(save_policy(tmp_path_factory.mktemp("policy")))


@pytest.fixture(scope="module")
def moment(agent):
    return moment_of(agent)


def test_there_is_a_response_for_each_component_direction_layer_and_head(agent, moment):
    response = responses_at(agent, *moment)
    assert response.groups == TOKENS
    assert response.gradient.shape == (10, 2)
    assert response.attention.shape == (3, 2, 10)
    assert response.waypoints.shape == (8, 2)
    assert (response.gradient > 0.0).all()


def test_the_waypoints_are_those_that_were_driven(agent, moment):
    with torch.inference_mode():
        driven = agent.plan(*moment).waypoints[0].numpy()
    assert np.array_equal(responses_at(agent, *moment).waypoints, driven)


def test_a_heads_attention_is_shared_out_whole(agent, moment):
    assert np.allclose(responses_at(agent, *moment).attention.sum(axis=2), 1.0)


def test_the_maps_lie_on_the_ego_grid_and_on_the_pictures_features(agent, moment):
    maps = activation_maps(agent, *moment)
    assert maps["bev"].shape == (CONFIG.grid.cells, CONFIG.grid.cells)
    assert maps["camera_front"].shape == (21, 21)  # 84 pixels at stride 4
    assert all((part >= 0.0).all() and part.any() for part in maps.values())


def test_one_look_sees_what_two_do(agent, moment):
    look = look_at(agent, *moment)
    assert np.array_equal(look.response.gradient, responses_at(agent, *moment).gradient)
    assert np.array_equal(look.maps["bev"], activation_maps(agent, *moment)["bev"])


def test_a_component_is_as_long_as_all_its_tokens_gradients_together(agent, moment):
    response = responses_at(agent, *moment)
    tokens = token_gradients(agent.explainable(), *moment)
    assert tokens["bev"].shape == (2, 3, 16)  # objects, signals and features, of width 16
    for name, (x, y) in zip(response.groups, response.gradient, strict=True):
        assert np.isclose(np.sqrt((tokens[name][0] ** 2).sum()), x)
        assert np.isclose(np.sqrt((tokens[name][1] ** 2).sum()), y)


def test_a_policy_without_sensors_has_no_maps_and_no_bev(tmp_path):
    config = PolicyConfig(
        name="prompt", camera=None, lidar=None, memory_frames=0, planner=CONFIG.planner
    )
    agent = agent_of(save_policy(tmp_path, config=config))
    look = look_at(agent, *moment_of(agent, steps=1))
    assert look.maps == {}
    assert look.response.groups == TOKENS[:-1]


def test_a_component_that_the_policy_is_never_given_is_left_out(tmp_path):
    config = PolicyConfig(
        name="prompt",
        camera=None,
        lidar=None,
        memory_frames=0,
        planner=CONFIG.planner,
        prompt=("routing", "speed"),
    )
    agent = agent_of(save_policy(tmp_path, config=config))
    response = responses_at(agent, *moment_of(agent, steps=1))
    assert response.groups == ("routing", "speed")
    # the other seven zero tokens get the rest of the attention
    assert (response.attention.sum(axis=2) < 1.0).all()


def test_it_is_looked_at_with_the_edits_that_it_drives_with(agent, moment):
    edited = agent.edited(read_edits("drop:bev"))
    response = responses_at(edited, *moment)
    bev = response.groups.index("bev")
    assert (response.gradient[bev] == 0.0).all()  # whatever the encoder says, it is cut off
    assert not np.array_equal(response.waypoints, responses_at(agent, *moment).waypoints)
