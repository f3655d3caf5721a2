"""LiDAR encoder: voxels, sparse convolutions, flattened to BEV, an hourglass, a feature pyramid.

Source: the paper, section 3.1, "Lidar Encoder"; SECOND's layout (Yan et al., Sensors 2018).
"""

from __future__ import annotations

from itertools import pairwise

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.driveinsight.config import GridConfig, LidarEncoderConfig
from agents.driveinsight.pyramid import FeaturePyramid
from agents.driveinsight.sparse import HalvingBlock, SparseVoxels, SubmanifoldBlock
from agents.networks.taps import Tap

POINT_FEATURES = 5  # offset from the voxel's centre (3), height, intensity


def voxelise(points: Tensor, grid: GridConfig, config: LidarEncoderConfig) -> SparseVoxels:
    """Means of the points in each voxel.

    Args:
        points: (B, P, 4) x, y, z in the ego's frame [m] and intensity; rows of zeros are no points.
        grid: What lies outside is left out.
        config: Sizes of voxels.

    Returns:
        Voxels with `POINT_FEATURES` and the logarithm of their number of points.
    """
    low = points.new_tensor([grid.x_min_m, grid.y_min_m, grid.z_min_m])
    high = points.new_tensor([grid.x_max_m, grid.y_max_m, grid.z_max_m])
    size = points.new_tensor([config.voxel_m, config.voxel_m, config.voxel_z_m])
    width, height, depth = voxel_counts(grid, config)
    limit = torch.tensor([width, height, depth], device=points.device)
    xyz = points[..., :3]
    inside = ((xyz >= low) & (xyz < high)).all(dim=2) & (points != 0.0).any(dim=2)
    sample, row = inside.nonzero(as_tuple=True)
    chosen = points[sample, row]  # (V', 4)
    # Rounding may lift a point just below the upper edge onto it.
    place = ((chosen[:, :3] - low) / size).long().minimum(limit - 1)
    x, y, z = place.unbind(1)
    key = ((sample * depth + z) * width + x) * height + y
    found, inverse, counts = key.unique(return_inverse=True, return_counts=True)
    offset = (chosen[:, :3] - low) / size - place - 0.5
    features = torch.cat([offset, chosen[:, 2:3] / 2.0, chosen[:, 3:]], dim=1)
    sums = features.new_zeros(len(found), POINT_FEATURES).index_add(0, inverse, features)
    means = sums / counts[:, None]
    b = found // (depth * width * height)
    index = torch.stack(
        [b, found // (width * height) % depth, found // height % width, found % height], dim=1
    )
    return SparseVoxels(
        features=torch.cat([means, counts[:, None].to(means).log()], dim=1),
        index=index,
        shape=(depth, width, height),
        batch=len(points),
    )


def voxel_counts(grid: GridConfig, config: LidarEncoderConfig) -> tuple[int, int, int]:
    """Voxels along x, y and z.

    Raises:
        ValueError: If their levels do not end at the grid's cells.
    """
    width = round((grid.x_max_m - grid.x_min_m) / config.voxel_m)
    height = round((grid.y_max_m - grid.y_min_m) / config.voxel_m)
    depth = round((grid.z_max_m - grid.z_min_m) / config.voxel_z_m)
    halvings = 2 ** (len(config.widths) - 1)
    if (width, height) != (grid.cells * halvings, grid.cells * halvings):
        raise ValueError(
            f"{width} x {height} voxels, halved {len(config.widths) - 1} times, do not give "
            f"{grid.cells} x {grid.cells} cells; choose voxel_m or widths to fit"
        )
    return width, height, depth


class Hourglass(nn.Module):
    """Two halvings and, back up, a pyramid: sees further without losing place."""

    def __init__(self, inputs: int, channels: int) -> None:
        super().__init__()
        self.enter = _normed_conv(inputs, channels, 1)
        self.down1 = _normed_conv(channels, channels, 2)
        self.down2 = _normed_conv(channels, channels, 2)
        self.pyramid = FeaturePyramid([channels] * 3, channels)

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, X, Y) to (B, channels, X, Y)."""
        fine = self.enter(x)
        middle = self.down1(fine)
        return self.pyramid([fine, middle, self.down2(middle)])


def _normed_conv(inputs: int, outputs: int, stride: int) -> nn.Module:
    conv = nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False)
    return nn.Sequential(conv, nn.BatchNorm2d(outputs), nn.ReLU())


class LidarEncoder(nn.Module):
    """A point cloud to a BEV feature map."""

    def __init__(self, config: LidarEncoderConfig, grid: GridConfig) -> None:
        super().__init__()
        self.config, self.grid = config, grid
        self.blocks = nn.Sequential(SubmanifoldBlock(POINT_FEATURES + 1, config.widths[0]))
        for finer, coarser in pairwise(config.widths):
            self.blocks.append(HalvingBlock(finer, coarser))
            self.blocks.append(SubmanifoldBlock(coarser, coarser))
        depth = voxel_counts(grid, config)[2]
        for _ in config.widths[1:]:
            depth = (depth + 1) // 2
        self.hourglass = Hourglass(config.widths[-1] * depth, config.channels)
        self.bev = Tap()

    def forward(self, points: Tensor) -> Tensor:
        """(B, P, 4) points, see `voxelise`, to (B, C, X, Y)."""
        voxels = self.blocks(voxelise(points, self.grid, self.config))
        flat = voxels.dense().flatten(1, 2)  # (B, C*Z, X, Y)
        return self.bev(F.relu(self.hourglass(flat)))
