"""Memory: what was seen stays where it is in the world while the ego moves."""

from __future__ import annotations

import math

import torch

from agents.driveinsight.memory import TemporalFusion, bank_of_sequence, empty_bank, warp
from agents.networks.grid import GridConfig

GRID = GridConfig()


def seen_at(cell_x, cell_y):
    features = torch.zeros(1, 1, 48, 48)
    features[0, 0, cell_x, cell_y] = 1.0
    return features


def pose(x, y, yaw):
    return torch.tensor([[x, y, yaw]])


def test_standing_still_changes_nothing():
    features = torch.randn(1, 3, 48, 48, generator=torch.Generator().manual_seed(0))
    here = pose(120.0, -7.0, 0.3)
    assert torch.allclose(warp(features, here, here, GRID), features, atol=1e-4)


def test_four_metres_ahead_bring_a_feature_five_cells_nearer():
    moved = warp(seen_at(30, 24), pose(10.0, 2.0, 0.0), pose(14.0, 2.0, 0.0), GRID)
    assert moved[0, 0, 25, 24] > 0.999


def test_a_quarter_turn_to_the_right_brings_what_was_on_the_right_ahead():
    # Cell (10, 39): x = -8 + 10.5 x 0.8 = 0.4 m, y = -19.2 + 39.5 x 0.8 = 12.4 m to the right.
    # After the turn it is 12.4 m ahead and 0.4 m to the left: (20.4 / 0.8, 18.8 / 0.8) = (25, 23).
    moved = warp(seen_at(10, 39), pose(0.0, 0.0, 0.0), pose(0.0, 0.0, math.pi / 2), GRID)
    assert moved[0, 0, 25, 23] > 0.999


def test_the_bank_keeps_the_newest_frames_and_forgets_the_oldest():
    bank = empty_bank(1, 2, 1, 48, like=torch.zeros(1))
    assert not bank.valid.any()
    for step in range(3):
        bank = bank.remember(torch.full((1, 1, 48, 48), float(step)), pose(float(step), 0.0, 0.0))
    assert bank.valid.all()
    assert bank.features[0, :, 0, 0, 0].tolist() == [2.0, 1.0]
    assert bank.poses[0, :, 0].tolist() == [2.0, 1.0]


def test_an_empty_slot_counts_for_nothing_whatever_lies_in_it():
    fusion = TemporalFusion(1, 1, 2, (4, 4), GRID).eval()
    empty = empty_bank(1, 2, 1, 48, like=torch.zeros(1))
    full = empty_bank(1, 2, 1, 48, like=torch.zeros(1))
    full.features.fill_(9.0)
    here, now = pose(0.0, 0.0, 0.0), seen_at(5, 5)
    assert torch.equal(fusion(now, here, empty), fusion(now, here, full))


def test_in_a_sequence_each_moment_remembers_those_before_it_as_one_by_one():
    frames = torch.randn(2, 4, 1, 8, 8, generator=torch.Generator().manual_seed(0))
    poses = torch.arange(24.0).view(2, 4, 3)
    whole = bank_of_sequence(frames, poses, 2)
    bank = empty_bank(2, 2, 1, 8, like=frames)
    for t in range(4):
        rows = torch.tensor([t, 4 + t])  # of both sequences
        assert torch.equal(whole.valid[rows], bank.valid)
        there = bank.valid[..., None]
        assert torch.equal(whole.poses[rows] * there, bank.poses * there)
        assert torch.equal(whole.features[rows], bank.features)
        bank = bank.remember(frames[:, t], poses[:, t])


def test_what_is_remembered_learns_from_those_who_remember_it():
    frames = torch.zeros(1, 3, 1, 8, 8, requires_grad=True)
    bank = bank_of_sequence(frames, torch.zeros(1, 3, 3), 1)
    bank.features[2].sum().backward()  # the last moment remembers the one before it
    assert frames.grad[0].flatten(1).sum(dim=1).tolist() == [0.0, 64.0, 0.0]
