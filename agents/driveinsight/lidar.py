"""LiDAR encoder: points counted in pillars of half a cell and slices of height, then convolved.

Source: the paper, section 3.1, "Lidar Encoder"; Lang et al., PointPillars, CVPR 2019. What we
changed: what a pillar holds is counted, not learnt, so that the map is dense and cheap. A sweep of
5,600 rays leaves no more than a few points in a pillar.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from agents.driveinsight.config import LidarEncoderConfig
from agents.networks.blocks import conv_block
from agents.networks.grid import GridConfig
from agents.networks.taps import Tap

FINER = 2  # pillars a cell, along x and along y


class Pillars(nn.Module):
    """Points to a dense map of what is where at which height."""

    edges: Tensor

    def __init__(self, config: LidarEncoderConfig, grid: GridConfig) -> None:
        super().__init__()
        self.grid, self.sides = grid, grid.cells * FINER
        self.register_buffer("edges", torch.tensor(config.heights_m), persistent=False)
        self.channels = len(config.heights_m) + 1

    def forward(self, points: Tensor) -> Tensor:
        """Counts.

        Args:
            points: (B, P, 4) x, y, z in the ego's frame [m] and intensity; rows of zeros are none.

        Returns:
            (B, channels, X*2, Y*2): the logarithm of one and the points in each slice, then the
            height of the topmost point and the mean intensity, all 0 where there is no point.
        """
        grid, sides = self.grid, self.sides
        batch, slices = len(points), self.channels - 2
        x, y, z, intensity = points.float().unbind(2)
        column = ((x - grid.x_min_m) / (grid.x_max_m - grid.x_min_m) * sides).floor().long()
        row = ((y - grid.y_min_m) / (grid.y_max_m - grid.y_min_m) * sides).floor().long()
        slice_ = torch.bucketize(z.contiguous(), self.edges, right=True) - 1
        inside = (column >= 0) & (column < sides) & (row >= 0) & (row < sides)
        inside &= (slice_ >= 0) & (slice_ < slices) & (points != 0.0).any(dim=2)
        sample = torch.arange(batch, device=points.device)[:, None].expand_as(column)
        pillar = ((sample * sides + column) * sides + row)[inside]  # (P',)
        counts = points.new_zeros(batch * sides * sides, slices)
        place = pillar * slices + slice_[inside]
        counts.view(-1).index_add_(0, place, torch.ones_like(pillar, dtype=counts.dtype))
        top = points.new_zeros(batch * sides * sides)
        low = float(self.edges[0])
        top.scatter_reduce_(0, pillar, z[inside] - low, "amax")
        bright = points.new_zeros(batch * sides * sides).index_add_(0, pillar, intensity[inside])
        bright = bright / counts.sum(dim=1).clamp(min=1.0)
        out = torch.cat([counts.log1p(), top[:, None] / 4.0, bright[:, None]], dim=1)
        return out.view(batch, sides, sides, -1).permute(0, 3, 1, 2)


class LidarEncoder(nn.Module):
    """A point cloud to a BEV feature map."""

    def __init__(self, config: LidarEncoderConfig, grid: GridConfig) -> None:
        super().__init__()
        self.pillars = Pillars(config, grid)
        self.mix = conv_block(self.pillars.channels, config.channels, stride=FINER)
        self.bev = Tap()

    def forward(self, points: Tensor) -> Tensor:
        """(B, P, 4) points, see `Pillars`, to (B, C, X, Y)."""
        return self.bev(self.mix(self.pillars(points)))
