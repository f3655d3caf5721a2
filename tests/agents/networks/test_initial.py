"""First weights: what differs at the way in still differs after many layers."""

from __future__ import annotations

import torch
from torch import nn

from agents.networks.initial import begin_as_he
from agents.training.trainees import config_named
from agents.zoo.registry import network_of

DEEP = 10


def spread(network, inputs):
    """The mean square of what comes out, where what goes in has 1."""
    with torch.no_grad():
        return float(network(torch.randn(inputs)).square().mean())


def test_a_signal_is_as_strong_after_ten_layers_and_by_torchs_own_weights_it_is_gone():
    torch.manual_seed(0)
    layers = [part for _ in range(DEEP) for part in (nn.Linear(256, 256), nn.ReLU())]
    network = nn.Sequential(*layers, nn.Linear(256, 256))
    for part in network:
        if isinstance(part, nn.Linear):
            nn.init.zeros_(part.bias)  # they say nothing of the input
    assert spread(network, (64, 256)) < 1e-6
    begin_as_he(network)
    assert 0.3 < spread(network, (64, 256)) / 2.0 < 3.0  # the last layer has no ReLU behind it


def test_convolutions_too_and_their_biases_are_zero():
    torch.manual_seed(0)
    network = nn.Sequential(nn.Conv2d(16, 64, 3, padding=1), nn.ReLU())
    begin_as_he(network)
    assert not network[0].bias.any()
    assert 0.8 < spread(network, (8, 16, 24, 24)) < 1.2


def test_a_fresh_mile_plans_otherwise_on_another_route():
    config = config_named("mile")
    torch.manual_seed(0)
    network = network_of(config).eval()
    seen = {
        "camera_front": torch.zeros(2, 3, 144, 256),
        "camera_front_narrow": torch.zeros(2, 3, 128, 320),
        "speed": torch.full((2, 1), 5.0),
    }
    ahead = torch.arange(50.0)
    left = torch.stack([ahead, -0.02 * ahead**2, -0.04 * ahead, torch.ones(50)], dim=1)
    right = left * torch.tensor([1.0, -1.0, -1.0, 1.0])
    with torch.no_grad():
        plans = network({**seen, "routing": torch.stack([left, right])}).waypoints
    assert float((plans[0] - plans[1]).abs().max()) > 0.05, plans
