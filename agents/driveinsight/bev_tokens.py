"""What the policy sees for itself, as tokens: the component `bev`.

Rows that perception read off its maps go through the encoders of told rows. Beside them stands one
token of BEV features along the way: what no row says, such as where a lane is free.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.driveinsight.config import PlannerConfig
from agents.driveinsight.seen import Seen
from agents.driveinsight.tokens import PromptEncoder
from agents.networks.grid import GridConfig
from agents.networks.route_frame import SPACING_M
from agents.networks.taps import Tap

_EVERY_M = 4.0  # along the way, features are looked up
_ASIDE_M = (-3.5, 0.0, 3.5)  # a lane to the left, the way itself, a lane to the right


class WayFeatures(nn.Module):
    """BEV features along the route, or straight ahead where none is told, to one token.

    The last layer begins at zero: a planner that was trained without features goes on as it was.
    """

    def __init__(self, channels: int, grid: GridConfig, config: PlannerConfig) -> None:
        super().__init__()
        self.grid = grid
        self.stations = int((grid.x_max_m - 1.0) // _EVERY_M)
        self.mix = nn.Sequential(
            nn.Linear(channels * self.stations * len(_ASIDE_M), config.width), nn.ReLU()
        )
        self.out = nn.Linear(config.width, config.width)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def forward(self, bev: Tensor, routing: Tensor) -> Tensor:
        """(B, C, X, Y) and (B, R, 4) to (B, 1, width)."""
        where = way_points(routing, self.stations)  # (B, S, A, 2)
        grid = self.grid
        # grid_sample's first axis is the last of the map, y; -1 and 1 are the grid's edges
        along_x = 2.0 * (where[..., 0] - grid.x_min_m) / (grid.x_max_m - grid.x_min_m) - 1.0
        along_y = 2.0 * (where[..., 1] - grid.y_min_m) / (grid.y_max_m - grid.y_min_m) - 1.0
        places = torch.stack([along_y, along_x], dim=-1)
        # places are whole in mixed precision too: bfloat16 would move them by up to 20 cm
        found = F.grid_sample(bev.float(), places, align_corners=False)  # (B, C, S, A)
        token: Tensor = self.out(self.mix(found.flatten(1)))[:, None]
        return token


def way_points(routing: Tensor, stations: int) -> Tensor:
    """Where features are looked up.

    Args:
        routing: (B, R, 4) x, y, yaw, valid of the route's points; none valid where it is not told.
        stations: How many places along the way.

    Returns:
        (B, stations, 3, 2) x, y [m] in the ego frame; straight ahead where there is no point.
    """
    ahead = torch.arange(1, stations + 1, device=routing.device) * _EVERY_M
    chosen = routing[:, ((ahead / SPACING_M).long() - 1).clamp(max=routing.shape[1] - 1)]
    there = chosen[..., 3:]
    straight = torch.stack([ahead, 0.0 * ahead, 0.0 * ahead], dim=1)  # (S, 3)
    x, y, yaw = (chosen[..., :3] * there + straight * (1.0 - there)).unbind(dim=2)
    aside = torch.tensor(_ASIDE_M, device=routing.device)
    return torch.stack(
        [
            x[..., None] - yaw.sin()[..., None] * aside,
            y[..., None] + yaw.cos()[..., None] * aside,
        ],
        dim=-1,
    )


class BevTokens(nn.Module):
    """Seen rows and BEV features to the tokens of the component `bev`."""

    def __init__(self, channels: int, grid: GridConfig, config: PlannerConfig) -> None:
        super().__init__()
        self.way = WayFeatures(channels, grid, config)
        self.tokens = Tap()

    def forward(
        self, seen: Seen, bev: Tensor | None, route: Tensor, present: Tensor, rows: PromptEncoder
    ) -> Tensor:
        """Encodes.

        Args:
            seen: What perception says is there.
            bev: (B, C, X, Y) its features; None where only rows are known.
            route: (B, R, 4) as `tokens.told_route` gives it.
            present: (B,) 0 or 1.
            rows: Whose encoders of rows are taken.

        Returns:
            (B, N, width): objects, signals, and one of features; all zeros where not present.
        """
        objects = rows.objects(seen.objects, route)
        signals = rows.signals(seen.signals, route)
        way = torch.zeros_like(objects[:, :1]) if bev is None else self.way(bev, route)
        return self.tokens(torch.cat([objects, signals, way], dim=1) * present[:, None, None])
