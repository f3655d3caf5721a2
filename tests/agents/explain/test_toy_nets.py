"""Nets with gradients that can be worked out on paper: responses and maps to 1e-6."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from torch import nn

from agents.explain.activation import activation_map, activation_maps
from agents.explain.protocol import Anatomy, FeatureMap, TokenGroup
from agents.explain.responses import responses_at, token_gradients
from tests.agents.explain.toy_policies import LinearNet, ToyAgent

SEEN = {"way": torch.ones(1, 2), "others": torch.ones(1, 2, 2)}
GROUPS = {
    "way": TokenGroup(tap="way"),
    "others": TokenGroup(tap="others"),
    "second": TokenGroup(tap="others", rows=(1, 2)),
}


def test_gradients_of_a_linear_net_are_its_weights():
    """Waypoints are p and 2p, so the mean is 1.5p: |a| = 5, |b| = sqrt(1+4+4+16) = 5."""
    response = responses_at(ToyAgent(LinearNet(), Anatomy(groups=GROUPS)), SEEN, None)
    expected = [[7.5, 0.0], [0.0, 7.5], [0.0, 1.5 * math.sqrt(20.0)]]
    assert np.abs(response.gradient - expected).max() < 1e-6
    assert np.allclose(response.waypoints, [[7.0, 9.0], [14.0, 18.0]])
    assert response.attention.shape == (0, 0, 3)


def test_each_token_has_a_gradient_of_its_own():
    gradients = token_gradients(ToyAgent(LinearNet(), Anatomy(groups=GROUPS)), SEEN, None)
    assert np.abs(gradients["way"] - [[[4.5, 6.0]], [[0.0, 0.0]]]).max() < 1e-6
    assert np.abs(gradients["second"][1] - [[3.0, 6.0]]).max() < 1e-6


class Squares(nn.Module):
    """x is the sum of squares of channel 0, y that of channel 1 times 3."""

    def __init__(self) -> None:
        super().__init__()
        self.features = nn.Identity()

    def forward(self, picture: torch.Tensor) -> torch.Tensor:
        features = self.features(picture)  # (1, 2, 2, 2)
        sums = (features[0] ** 2).sum(dim=(1, 2)) * torch.tensor([1.0, 3.0])
        return sums[None]


def test_an_activation_map_by_hand():
    """dp^x/dA^0 = 2 A^0, mean 2 * 2.5 = 5; dp^y/dA^1 = 6 A^1, mean 6 * 1 = 6."""
    picture = torch.tensor([[[[1.0, 2.0], [3.0, 4.0]], [[1.0, 1.0], [2.0, 0.0]]]])
    anatomy = Anatomy(maps={"front": FeatureMap(tap="features")})
    found = activation_maps(ToyAgent(Squares(), anatomy), {"picture": picture}, None)["front"]
    expected = np.hypot(5.0 * picture[0, 0].numpy(), 6.0 * picture[0, 1].numpy())
    assert np.abs(found - expected).max() < 1e-5 * expected.max()
    assert found[1, 0] == pytest.approx(math.hypot(15.0, 12.0), abs=1e-5)


def test_the_two_formulas_on_numbers():
    features = torch.tensor([[[2.0, 0.0]], [[0.0, 5.0]]])  # two channels of 1 x 2
    gradients = torch.tensor(
        [[[[1.0, 3.0]], [[0.0, 0.0]]], [[[0.0, 0.0]], [[4.0, -2.0]]]]
    )  # alpha^x = (2, 0), alpha^y = (0, 1)
    assert torch.allclose(activation_map(features, gradients), torch.tensor([[4.0, 5.0]]))


class Attending(nn.Module):
    """One layer, two heads, two queries; three keys."""

    def __init__(self) -> None:
        super().__init__()
        self.tokens, self.weights = nn.Identity(), nn.Identity()

    def forward(self, tokens: torch.Tensor) -> torch.Tensor:
        tokens = self.tokens(tokens)
        rows = torch.tensor([[[0.5, 0.3, 0.2], [0.1, 0.1, 0.8]], [[1.0, 0.0, 0.0]] * 2])
        weights = self.weights(rows[None])  # (1, 2 heads, 2 queries, 3 keys)
        return (weights.sum(dim=(1, 2)) @ tokens[0])[:, :2]


def test_a_components_attention_is_that_of_all_its_tokens_over_all_queries():
    anatomy = Anatomy(
        groups={
            "a": TokenGroup(tap="tokens", rows=(0, 1), keys=(0, 1)),
            "b": TokenGroup(tap="tokens", rows=(1, 3), keys=(1, 3)),
            "unseen": TokenGroup(tap="tokens", rows=(0, 1)),
        },
        attention=("weights",),
    )
    response = responses_at(ToyAgent(Attending(), anatomy), {"tokens": torch.ones(1, 3, 2)}, None)
    expected = [[[0.3, 0.7, 0.0], [1.0, 0.0, 0.0]]]
    assert np.allclose(response.attention, expected)
