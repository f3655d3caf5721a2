"""The paper's own sizes: four pictures of 1600x900, ResNet-50. Built, and one pass each way."""

from __future__ import annotations

import dataclasses
import os

import pytest
import torch

from agents.driveinsight.config import config_named
from agents.driveinsight.losses import LossConfig, losses
from agents.driveinsight.model import Policy
from tests.agents.driveinsight.random_inputs import random_inputs, random_targets

MEMORY_BYTES = 8e9  # 6 GB at most were seen


def assert_a_pass_each_way(config):
    """In mixed precision, as it is trained; returns what came out."""
    torch.manual_seed(0)
    policy = Policy(config).train()
    inputs = random_inputs(config)
    with torch.autocast("cpu", torch.bfloat16):
        output = policy(inputs)
    assert output.waypoints.shape == (1, 8, 2)
    losses(output, random_targets(output), LossConfig())["total"].backward()
    for name, value in policy.named_parameters():
        if name.startswith(("perception.memory.keep.", "bev.way.mix.")):
            continue  # of one moment nothing is remembered; a layer that begins at zero comes next
        assert value.grad is not None, name
        assert torch.isfinite(value.grad).all(), name
        assert value.grad.abs().sum() > 0.0, name
    return output


def test_the_papers_sizes_pass_both_ways():
    free_bytes = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if free_bytes < MEMORY_BYTES:
        pytest.skip(f"it wants {MEMORY_BYTES / 1e9:.0f} GB of memory, {free_bytes / 1e9:.1f} free")
    output = assert_a_pass_each_way(config_named("paper"))
    # 900 / 16 rounded up, 1600 / 16
    assert [logits.shape for logits in output.encoded.depth] == [(1, 4, 40, 57, 100)]
    assert output.bev.shape == (1, 128, 96, 96)


def test_the_papers_network_with_small_pictures_passes_both_ways():
    paper = config_named("paper")
    camera = dataclasses.replace(paper.camera, rig="small")
    output = assert_a_pass_each_way(dataclasses.replace(paper, camera=camera))
    assert [logits.shape for logits in output.encoded.depth] == [(1, 4, 40, 9, 16)]
