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
_LANE_M = 2.0  # what lies no farther from the route than this is in the ego's way
_SAME_WAY = 0.7  # cosine of the angle between a line of its own and the way, at least
_THERE = 0.3  # who is seen with less certainty is no reason to stop for


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


def along_route(seen: OnRoute) -> Tensor:
    """Rows as the route sees them, for a network.

    Returns:
        (B, K, ROUTE_COLUMNS) scaled: station along the route, place to its right, closeness to it
        (1 on it, falling with distance), cosine and sine of the row's yaw seen from the route's,
        speed along and across it (to the right), 1. All zero where no point is valid.
    """
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


def in_the_way(seen: OnRoute, *, same_way: bool) -> Tensor:
    """(B, K) whether rows lie on the route, from the ego's middle on.

    Args:
        seen: Rows as the route sees them.
        same_way: Whether only those count that point along it, as a stop line of one's own does.
    """
    there = (seen.valid > 0.0) & (seen.station_m > -SPACING_M) & (seen.aside_m.abs() < _LANE_M)
    return there & (seen.bend_rad.cos() > _SAME_WAY) if same_way else there


def next_on_route(seen: OnRoute, presence: Tensor, rows: Tensor, *, same_way: bool) -> Tensor:
    """The row that one comes to first along the route.

    Args:
        seen: (B, K) rows as the route sees them.
        presence: (B, K) 0..1; who is less there than `_THERE` is not come to.
        rows: (B, K, F) what is wanted of it.
        same_way: As for `in_the_way`.

    Returns:
        (B, F) of that row; zeros where there is none.
    """
    there = in_the_way(seen, same_way=same_way) & (presence >= _THERE)
    station_m = torch.where(there, seen.station_m, torch.inf)
    nearest_m, first = station_m.min(dim=1)  # (B,)
    found = rows.gather(1, first[:, None, None].expand(-1, 1, rows.shape[2]))[:, 0]
    return torch.where(nearest_m[:, None].isfinite(), found, 0.0)
