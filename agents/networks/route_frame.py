"""What a row means for the way ahead: where it lies along the route, and how it moves along it.

The same car is one thing beside the route and another on it. Every number here is derived from the
route's points, so all of them are zero where these are not told: no component tells another.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

ROUTE_COLUMNS = 8
SPACING_M = 1.0  # between the route's points
_METRES, _ASIDE_M, _CLOSE_M, _SPEED = 20.0, 5.0, 3.0, 10.0  # what numbers are divided by
_MOST = 4.0  # up to which a scaled place aside is told apart
_FAR_M2 = 1e6  # of a point that is not there


@dataclass(frozen=True, kw_only=True)
class OnRoute:
    """Rows as the route sees them, (B, K) each; of no meaning where `valid` is 0.

    Attributes:
        station_m: Along the route, from its first point.
        aside_m: To its right.
        squared_m2: Distance to its nearest point, squared.
        bend_rad: The row's yaw seen from the route's.
        along_mps: Speed along it.
        across_mps: Speed to its right.
        valid: 0 or 1, whether there is a route.
    """

    station_m: Tensor
    aside_m: Tensor
    squared_m2: Tensor
    bend_rad: Tensor
    along_mps: Tensor
    across_mps: Tensor
    valid: Tensor


def on_route(routing: Tensor, pose: Tensor, velocity: Tensor | None = None) -> OnRoute:
    """Where rows lie along a route, and how they move along it.

    Args:
        routing: (B, R, 4) x, y [m], yaw [rad], valid; points `SPACING_M` apart, ego frame.
        pose: (B, K, 3) x, y [m], yaw [rad] of each row.
        velocity: (B, K, 2) over the ground, ego frame [m/s]; None for what does not move.
    """
    offset = pose[:, :, None, :2] - routing[:, None, :, :2]  # (B, K, R, 2)
    squared = offset.square().sum(dim=3) + _FAR_M2 * (1.0 - routing[:, None, :, 3])
    squared, nearest = squared.min(dim=2)  # (B, K)
    points = routing.gather(1, nearest[:, :, None].expand(-1, -1, 4))  # (B, K, 4)
    cos, sin = points[:, :, 2].cos(), points[:, :, 2].sin()
    x, y = pose[:, :, 0] - points[:, :, 0], pose[:, :, 1] - points[:, :, 1]
    vx, vy = (0.0 * x, 0.0 * y) if velocity is None else velocity.unbind(dim=2)
    return OnRoute(
        station_m=nearest * SPACING_M + cos * x + sin * y,
        aside_m=cos * y - sin * x,
        squared_m2=squared,
        bend_rad=pose[:, :, 2] - points[:, :, 2],
        along_mps=cos * vx + sin * vy,
        across_mps=cos * vy - sin * vx,
        valid=points[:, :, 3],
    )


def along_route(routing: Tensor, pose: Tensor, velocity: Tensor | None = None) -> Tensor:
    """Rows as the route sees them, for a network.

    Args:
        routing: As for `on_route`, like the others.
        pose: (B, K, 3).
        velocity: (B, K, 2).

    Returns:
        (B, K, ROUTE_COLUMNS) scaled: station along the route, place to its right, closeness to it
        (1 on it, falling with distance), cosine and sine of the row's yaw seen from the route's,
        speed along and across it (to the right), 1. All zero where no point is valid.
    """
    seen = on_route(routing, pose, velocity)
    columns = [
        seen.station_m / _METRES,
        (seen.aside_m / _ASIDE_M).clamp(-_MOST, _MOST),
        (-seen.squared_m2.sqrt() / _CLOSE_M).exp(),
        seen.bend_rad.cos(),
        seen.bend_rad.sin(),
        seen.along_mps / _SPEED,
        seen.across_mps / _SPEED,
        torch.ones_like(seen.valid),
    ]
    return torch.stack(columns, dim=2) * seen.valid[:, :, None]
