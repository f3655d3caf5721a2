"""Lift and splat: features of pixels, spread along their rays by depth, gathered in BEV cells.

Where a pixel at a depth lands follows from the cameras' matrices alone, so it is worked out once;
what remains is one weighted sum a cell, which `embedding_bag` does without ever writing out the
frustum.
Source: Philion and Fidler, Lift, Splat, Shoot, ECCV 2020. What we changed: the
sums over cells are taken as they come, and only the grid's range decides what counts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.networks.grid import GridConfig
from di_envs.sensors.camera.config import CameraConfig


def growing_depths_m(nearest_m: float, farthest_m: float, bins: int) -> NDArray[np.float64]:
    """(bins,) distances ahead of a camera that a pixel may lie at, their steps growing evenly.

    What is far is seen less sharply: its depth need not be told apart so finely.
    """
    k = np.arange(bins)
    return nearest_m + (farthest_m - nearest_m) * k * (k + 1) / (bins * (bins - 1))


def frustum_points(
    camera: CameraConfig, stride: int, depths: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(H, W, D, 3) where the centres of a camera's feature pixels are at each depth, ego frame."""
    rows = (np.arange(-(-camera.height // stride)) + 0.5) * stride
    columns = (np.arange(-(-camera.width // stride)) + 0.5) * stride
    right = (columns - camera.width / 2.0) / camera.focal_px
    up = (camera.height / 2.0 - rows) / camera.focal_px
    ray = np.stack(
        np.broadcast_arrays(1.0, right[None, :], up[:, None]), axis=-1
    )  # (H, W, 3) ahead, right, up for each metre ahead
    points = ray[:, :, None] * depths[:, None]
    pose = camera.ego_from_camera()
    return points @ pose[:3, :3].T + pose[:3, 3]


def cells_of(points: NDArray[np.float64], grid: GridConfig) -> NDArray[np.int64]:
    """(...,) the cell, x by y, that (..., 3) points of the ego's frame lie in; -1 for none."""
    x = np.floor((points[..., 0] - grid.x_min_m) / grid.cell_x_m).astype(np.int64)
    y = np.floor((points[..., 1] - grid.y_min_m) / grid.cell_y_m).astype(np.int64)
    z = points[..., 2]
    inside = (x >= 0) & (x < grid.cells) & (y >= 0) & (y < grid.cells)
    inside &= (z >= grid.z_min_m) & (z < grid.z_max_m)
    return np.where(inside, x * grid.cells + y, -1)


class FrustumPooling(nn.Module):
    """Sums pixel features, weighted by their depths' probabilities, over each cell's points."""

    pixel: Tensor
    sample: Tensor
    start: Tensor

    def __init__(
        self,
        cameras: Sequence[CameraConfig],
        stride: int,
        depths: NDArray[np.float64],
        grid: GridConfig,
    ) -> None:
        super().__init__()
        self.grid = grid
        cell = np.concatenate(
            [cells_of(frustum_points(each, stride, depths), grid).reshape(-1) for each in cameras]
        )  # (N*H*W*D,)
        self.pixels = cell.size // depths.size
        order = np.argsort(cell, kind="stable")
        order = order[cell[order] >= 0]
        counts = np.bincount(cell[order], minlength=grid.cells**2)
        self.register_buffer("pixel", torch.from_numpy(order // depths.size), persistent=False)
        self.register_buffer("sample", torch.from_numpy(order), persistent=False)
        start = torch.from_numpy(np.cumsum(counts) - counts)
        self.register_buffer("start", start, persistent=False)

    def forward(self, features: Tensor, depth: Tensor) -> Tensor:
        """Gathers features in the grid.

        Args:
            features: (B, N, C, H, W) of each camera's pixels.
            depth: (B, N, D, H, W) probabilities, summing to 1 over D.

        Returns:
            (B, C, X, Y).
        """
        batch, channels, cells = features.shape[0], features.shape[2], self.grid.cells
        table = features.permute(0, 1, 3, 4, 2).reshape(-1, channels)  # (B*N*H*W, C)
        weights = depth.permute(0, 1, 3, 4, 2).reshape(batch, -1)  # (B, N*H*W*D)
        step = torch.arange(batch, device=features.device)[:, None]
        pooled = F.embedding_bag(
            (self.pixel + step * self.pixels).reshape(-1),
            table,
            (self.start + step * self.pixel.numel()).reshape(-1),
            mode="sum",
            per_sample_weights=weights[:, self.sample].reshape(-1),
        )  # (B*X*Y, C)
        return pooled.view(batch, cells, cells, channels).permute(0, 3, 1, 2)
