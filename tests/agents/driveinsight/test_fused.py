"""Norms folded into convolutions change nothing but the time it takes."""

from __future__ import annotations

import torch
from torch import nn

from agents.networks.blocks import conv_block
from agents.networks.fused import fuse_norms
from agents.networks.resnet import ResNet


def settled(network: nn.Module, images: torch.Tensor) -> nn.Module:
    """With means of what it has seen, so that its norms do something."""
    network.train()
    for _ in range(3):
        network(images)
    return network.eval()


def test_a_fused_network_says_the_same_and_has_no_norms_left():
    torch.manual_seed(0)
    images = torch.rand(2, 3, 32, 32) * 4.0 + 1.0
    network = nn.ModuleDict({"blocks": conv_block(3, 5), "resnet": ResNet("basic", (1, 1), 4)})
    for part in network.values():
        settled(part, images)
    before = [network["blocks"](images), *network["resnet"](images)]
    fuse_norms(network)
    after = [network["blocks"](images), *network["resnet"](images)]
    for one, other in zip(before, after, strict=True):
        assert torch.allclose(one, other, atol=1e-5)
    assert not any(isinstance(module, nn.BatchNorm2d) for module in network.modules())


def test_a_norm_that_follows_no_convolution_stays():
    network = nn.Sequential(nn.BatchNorm2d(3), nn.ReLU()).eval()
    fuse_norms(network)
    assert isinstance(network[0], nn.BatchNorm2d)
