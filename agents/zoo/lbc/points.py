"""Heatmaps to points, and points of the ground to where a camera shows them and back."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from agents.networks.grid import GridConfig
from di_envs.sensors.camera.config import CameraConfig

_NEAREST_M, _FARTHEST_M = 1.2, 60.0  # ahead of the camera, within which the ground is shown


class SpatialSoftmax(nn.Module):
    """Heatmaps to their mean places, as shares of their sides, with a temperature that is learnt.

    Source: Levine et al., End-to-End Training of Deep Visuomotor Policies, JMLR 2016.
    """

    def __init__(self) -> None:
        super().__init__()
        self.temperature = nn.Parameter(torch.ones(1))

    def forward(self, heat: Tensor) -> Tensor:
        """(B, T, rows, columns) to (B, T, 2) along rows, then columns, 0..1."""
        rows, columns = heat.shape[-2:]
        share = (heat.float().flatten(2) * self.temperature).softmax(dim=2).unflatten(2, (rows, -1))
        down = (torch.arange(rows, device=heat.device) + 0.5) / rows
        right = (torch.arange(columns, device=heat.device) + 0.5) / columns
        # no products of matrices: mixed precision would round places to a 256th of a side
        places = ((share.sum(3) * down).sum(2), (share.sum(2) * right).sum(2))
        return torch.stack(places, dim=2)


def heat_of(places: Tensor, rows: int, columns: int, radius: float) -> Tensor:
    """(B, 1, rows, columns) a bell around (B, 2) places, as shares of the sides.

    Args:
        places: Beyond 0..1 they are drawn at the edge.
        rows: Of the map.
        columns: Likewise.
        radius: Of the bell, in cells.
    """
    down = torch.arange(rows, device=places.device) + 0.5 - places[:, :1].clamp(0.0, 1.0) * rows
    right = (
        torch.arange(columns, device=places.device) + 0.5 - places[:, 1:].clamp(0.0, 1.0) * columns
    )
    squared = down[:, :, None].square() + right[:, None].square()
    return (-0.5 * squared / radius**2).exp()[:, None]


def share_of_grid(points: Tensor, grid: GridConfig) -> Tensor:
    """(..., 2) x, y [m] as shares of a grid's sides."""
    low = points.new_tensor([grid.x_min_m, grid.y_min_m])
    high = points.new_tensor([grid.x_max_m, grid.y_max_m])
    return (points - low) / (high - low)


def metres_of_grid(shares: Tensor, grid: GridConfig) -> Tensor:
    """The inverse of `share_of_grid`."""
    low = shares.new_tensor([grid.x_min_m, grid.y_min_m])
    high = shares.new_tensor([grid.x_max_m, grid.y_max_m])
    return low + shares * (high - low)


def share_of_image(points: Tensor, camera: CameraConfig) -> Tensor:
    """Where a level camera that looks ahead shows places of the ground.

    Args:
        points: (..., 2) x, y [m] in the ego frame; those that it does not show are brought to where
            it begins to.
        camera: Neither turned nor lifted.

    Returns:
        (..., 2) row and column, as shares of the picture's sides.
    """
    ahead = (points[..., 0] - camera.x_m).clamp(_NEAREST_M, _FARTHEST_M)
    row = 0.5 * camera.height + camera.focal_px * camera.z_m / ahead
    column = 0.5 * camera.width + camera.focal_px * (points[..., 1] - camera.y_m) / ahead
    shares = torch.stack([row / camera.height, column / camera.width], dim=-1)
    return shares.clamp(0.0, 1.0)


def metres_of_image(shares: Tensor, camera: CameraConfig) -> Tensor:
    """The inverse of `share_of_image`: (..., 2) x, y [m] of the ground, not beyond 60 m."""
    below = (shares[..., 0] - 0.5) * camera.height
    ahead = camera.focal_px * camera.z_m / below.clamp(min=camera.focal_px * camera.z_m / 60.0)
    right = (shares[..., 1] - 0.5) * camera.width * ahead / camera.focal_px
    return torch.stack([camera.x_m + ahead, camera.y_m + right], dim=-1)
