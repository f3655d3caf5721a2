"""What a row means for the way ahead: where it lies along the route, and how it moves along it.

The same car is one thing beside the route and another on it. Every number here is derived from the
route's points, so all of them are zero where these are not told: no component tells another.
"""

from __future__ import annotations

import torch
from torch import Tensor

ROUTE_COLUMNS = 8
SPACING_M = 1.0  # between the route's points
_METRES, _ASIDE_M, _CLOSE_M, _SPEED = 20.0, 5.0, 3.0, 10.0  # what numbers are divided by
_MOST = 4.0  # up to which a scaled place aside is told apart
_FAR_M2 = 1e6  # of a point that is not there


def along_route(routing: Tensor, pose: Tensor, velocity: Tensor | None = None) -> Tensor:
    """Rows as the route sees them.

    Args:
        routing: (B, R, 4) x, y [m], yaw [rad], valid; points `SPACING_M` apart, ego frame.
        pose: (B, K, 3) x, y [m], yaw [rad] of each row.
        velocity: (B, K, 2) over the ground, ego frame [m/s]; None for what does not move.

    Returns:
        (B, K, ROUTE_COLUMNS) scaled: station along the route, place to its right, closeness to it
        (1 on it, falling with distance), cosine and sine of the row's yaw seen from the route's,
        speed along and across it (to the right), 1. All zero where no point is valid.
    """
    offset = pose[:, :, None, :2] - routing[:, None, :, :2]  # (B, K, R, 2)
    squared = offset.square().sum(dim=3) + _FAR_M2 * (1.0 - routing[:, None, :, 3])
    squared, nearest = squared.min(dim=2)  # (B, K)
    points = routing.gather(1, nearest[:, :, None].expand(-1, -1, 4))  # (B, K, 4)
    cos, sin = points[:, :, 2].cos(), points[:, :, 2].sin()
    x, y = pose[:, :, 0] - points[:, :, 0], pose[:, :, 1] - points[:, :, 1]
    bend = pose[:, :, 2] - points[:, :, 2]
    vx, vy = (0.0 * x, 0.0 * y) if velocity is None else velocity.unbind(dim=2)
    columns = [
        (nearest * SPACING_M + cos * x + sin * y) / _METRES,
        ((cos * y - sin * x) / _ASIDE_M).clamp(-_MOST, _MOST),
        (-squared.sqrt() / _CLOSE_M).exp(),
        bend.cos(),
        bend.sin(),
        (cos * vx + sin * vy) / _SPEED,
        (cos * vy - sin * vx) / _SPEED,
        torch.ones_like(x),
    ]
    return torch.stack(columns, dim=2) * points[:, :, 3:]
