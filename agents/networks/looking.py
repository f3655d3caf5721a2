"""Features of a map of the ground at any places, bilinear between its cells."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from agents.networks.grid import GridConfig


def features_at(features: Tensor, places: Tensor, grid: GridConfig) -> Tensor:
    """Looks.

    Args:
        features: (B, C, X, Y) on the grid.
        places: (B, N, 2) x, y [m].
        grid: Of the features.

    Returns:
        (B, N, C); zeros outside the grid.
    """
    # grid_sample's first axis is the last of the map, y; -1 and 1 are the grid's edges
    along_x = 2.0 * (places[..., 0] - grid.x_min_m) / (grid.x_max_m - grid.x_min_m) - 1.0
    along_y = 2.0 * (places[..., 1] - grid.y_min_m) / (grid.y_max_m - grid.y_min_m) - 1.0
    where = torch.stack([along_y, along_x], dim=-1)[:, :, None]  # (B, N, 1, 2)
    # places are whole in mixed precision too
    found = F.grid_sample(features.float(), where.float(), align_corners=False)  # (B, C, N, 1)
    return found[..., 0].transpose(1, 2)
