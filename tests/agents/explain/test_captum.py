"""Captum, written by others, finds the same gradients and the same maps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from captum import attr
from torch import nn

from agents.explain.activation import activation_maps
from agents.explain.responses import token_gradients
from tests.agents.explain.small_policy import agent_of, moment_of, save_policy


@pytest.fixture(scope="module")
def agent(tmp_path_factory):
    return agent_of(save_policy(tmp_path_factory.mktemp("policy")))


@pytest.fixture(scope="module")
def moment(agent):
    return moment_of(agent)


class Forward(nn.Module):
    """What Captum calls: the mean waypoint (1, 2); its input is of no account."""

    def __init__(self, agent: Any, moment: Any) -> None:
        super().__init__()
        self.policy, self.agent, self.moment = agent.policy, agent, moment

    def forward(self, _unused: torch.Tensor) -> torch.Tensor:
        return self.agent.plan(*self.moment).waypoints.mean(dim=1)


UNUSED = torch.zeros(1, 1)


@pytest.mark.parametrize("name", ["routing", "speed", "traffic_lights", "bev"])
@pytest.mark.parametrize("direction", [0, 1])
def test_token_gradients_times_tokens_are_captums(agent, moment, name, direction):
    group = agent.explainable().anatomy.groups[name]
    layer = agent.policy.get_submodule(group.tap)
    forward = Forward(agent, moment)
    theirs = attr.LayerGradientXActivation(forward, layer).attribute(UNUSED, target=direction)
    tokens = attr.LayerActivation(forward, layer).attribute(UNUSED)
    gradient = token_gradients(agent.explainable(), *moment)[name][direction]
    ours = gradient * tokens.detach().numpy().reshape(gradient.shape)
    assert np.abs(ours - theirs.detach().numpy().reshape(ours.shape)).max() < 1e-5
    assert np.abs(ours).max() > 1e-5  # there is something to agree on


@pytest.mark.parametrize("name", ["bev", "camera_front"])
def test_maps_are_the_length_of_captums_grad_cam_in_x_and_y(agent, moment, name):
    part = agent.explainable().anatomy.maps[name]
    cam = attr.LayerGradCam(Forward(agent, moment), agent.policy.get_submodule(part.tap))
    each = [cam.attribute(UNUSED, target=c)[part.item, 0].detach().numpy() for c in (0, 1)]
    ours = activation_maps(agent, *moment)[name]
    assert np.abs(ours - np.hypot(*each)).max() < 1e-5 * max(1.0, ours.max())
    assert np.allclose(ours / ours.max(), np.hypot(*each) / ours.max(), atol=1e-5)
