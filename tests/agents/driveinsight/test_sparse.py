"""Sparse convolutions give what dense ones give where there are voxels."""

from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F

from agents.driveinsight.config import GridConfig, LidarEncoderConfig
from agents.driveinsight.lidar import LidarEncoder, voxelise
from agents.driveinsight.sparse import HalvingBlock, SparseVoxels, SubmanifoldBlock

SHAPE = (5, 8, 6)  # z is odd: the last layer has no partner


def voxels(batch=2, count=60, channels=3):
    draw = torch.Generator().manual_seed(0)
    key = torch.randperm(batch * 5 * 8 * 6, generator=draw)[:count].sort().values
    index = torch.stack([key // 240, key // 48 % 5, key // 6 % 8, key % 6], dim=1)
    features = torch.randn(count, channels, generator=draw)
    return SparseVoxels(features=features, index=index, shape=SHAPE, batch=batch)


def dense_of(block, size, x, stride):
    """What the same kernel gives on the dense grid, with the block's normalisation and ReLU."""
    kernel = block.conv.weight.permute(2, 1, 0).unflatten(2, (size, size, size))
    out = F.conv3d(x, kernel, stride=stride, padding=size // 2 if stride == 1 else 0)
    norm = block.norm
    return F.relu(F.batch_norm(out, norm.running_mean, norm.running_var, norm.weight, norm.bias))


def test_a_submanifold_convolution_equals_the_dense_one_at_its_voxels():
    block, given = SubmanifoldBlock(3, 4).eval(), voxels()
    dense = dense_of(block, 3, given.dense(), 1)
    b, z, x, y = given.index.unbind(1)
    assert torch.allclose(block(given).features, dense[b, :, z, x, y], atol=1e-5)


def test_a_halving_convolution_equals_the_dense_one():
    block, given = HalvingBlock(3, 4).eval(), voxels()
    padded = F.pad(given.dense(), (0, 0, 0, 0, 0, 1))  # to an even depth
    out = block(given)
    assert out.shape == (3, 4, 3)
    assert torch.allclose(out.dense(), dense_of(block, 2, padded, 2), atol=1e-5)


def test_a_voxel_holds_the_mean_of_its_points():
    # Both lie in the voxel from x 0.0 to 0.4, y 0.0 to 0.4, z 0 to 1: centre (0.2, 0.2, 0.5).
    points = torch.zeros(1, 4, 4)
    points[0, 1] = torch.tensor([0.1, 0.3, 0.25, 0.6])
    points[0, 2] = torch.tensor([0.3, 0.3, 0.75, 0.2])
    points[0, 3] = torch.tensor([99.0, 0.0, 0.0, 1.0])  # out of range
    got = voxelise(points, GridConfig(), LidarEncoderConfig())
    assert got.index.tolist() == [
        [0, 4, 20, 48]
    ]  # (0 + 4) / 1, (0.1 + 8) / 0.4, (0.3 + 19.2) / 0.4
    expected = [0.0, 0.25, 0.0, 0.25, 0.4, float(torch.tensor(2.0).log())]
    assert got.features[0].tolist() == pytest.approx(expected, abs=1e-5)


def test_an_empty_sweep_and_a_single_point_are_encoded():
    encoder = LidarEncoder(LidarEncoderConfig(), GridConfig())
    points = torch.zeros(1, 3, 4)
    assert torch.isfinite(encoder(points)).all()
    points[0, 0] = torch.tensor([5.0, 1.0, 1.0, 0.5])
    assert torch.isfinite(encoder(points)).all()


def test_levels_that_do_not_end_at_the_grid_are_refused():
    with pytest.raises(ValueError, match=r"192 x 192 voxels.* 48 x 48 cells"):
        LidarEncoder(LidarEncoderConfig(voxel_m=0.2), GridConfig())
