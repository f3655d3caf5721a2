"""Rows of the world to features: what is told and what is seen go through the same encoders.

Each row is told in the ego frame, and once more as the route sees it (`networks.route_frame`).
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.driveinsight.config import PlannerConfig
from agents.networks.mlp import mlp
from agents.networks.route_frame import (
    ROUTE_COLUMNS,
    OnRoute,
    along_route,
    next_on_route,
    on_route,
)
from agents.networks.sets import SetEncoder
from di_envs.town.lanes import LightState
from di_envs.town.map_chunks import POINTS, MapKind
from di_envs.world.kinds import ActorKind

METRES = 20.0  # coordinates are divided by this
SPEED = 10.0  # speeds [m/s] are divided by this
_SIZE = 5.0  # lengths and widths are divided by this
_MIDDLE = POINTS // 2  # of a polyline's points


def one_hot(column: Tensor, classes: int) -> Tensor:
    """(...) whole numbers as (..., classes) 0 or 1; those out of range count as the nearest."""
    return F.one_hot(column.long().clamp(0, classes - 1), classes).float()


def pose_features(pose: Tensor) -> Tensor:
    """(..., 3) x, y, yaw to (..., 4) scaled place, cosine and sine."""
    yaw = pose[..., 2:3]
    return torch.cat([pose[..., :2] / METRES, yaw.cos(), yaw.sin()], dim=-1)


class RowEncoder(nn.Module):
    """Rows to tokens: one for all of them, or one for each; and one more for what comes next.

    A light is one of up to a dozen in sight. What the ego does depends on the one that it comes to,
    and a token for all of them has to tell that one's state from the others'.

    Args:
        inputs: Columns of a row.
        width: Of a token.
        each: A token a row, instead of one for all.
        next_row: One more, for the row that the ego comes to first along the route.
        same_way: Whether only a row that points along the route is come to.
    """

    def __init__(
        self,
        inputs: int,
        width: int,
        *,
        each: bool,
        next_row: bool = False,
        same_way: bool = False,
    ) -> None:
        super().__init__()
        self.rows = mlp(inputs, width) if each else SetEncoder(inputs, width)
        self.next = mlp(inputs, width) if next_row else None
        self._each, self._same_way = each, same_way

    def forward(self, rows: Tensor, presence: Tensor, seen: OnRoute) -> Tensor:
        """Encodes.

        Args:
            rows: (B, K, F).
            presence: (B, K) 0..1.
            seen: The rows as the route sees them.

        Returns:
            (B, K or 1, width), and one token more for what comes next; zeros for rows that are not
            there.
        """
        if self._each:
            tokens: Tensor = self.rows(rows) * presence[:, :, None]
        else:
            tokens = self.rows(rows, presence)[:, None]
        if self.next is None:
            return tokens
        columns = torch.cat([rows, presence[:, :, None]], dim=2)
        first = next_on_route(seen, presence, columns, same_way=self._same_way)
        return torch.cat([tokens, (self.next(first[:, :-1]) * first[:, -1:])[:, None]], dim=1)


class ObjectEncoder(nn.Module):
    """Vehicles and walkers, told or seen."""

    def __init__(self, config: PlannerConfig) -> None:
        super().__init__()
        inputs = 9 + len(ActorKind) + ROUTE_COLUMNS
        self.encode = RowEncoder(
            inputs, config.width, each=config.each_row, next_row=config.next_row
        )

    def forward(self, rows: Tensor, routing: Tensor) -> Tensor:
        """(B, K, 9) with the columns of the prompt's obstacles to (B, N, width)."""
        seen = on_route(routing, rows[..., :3], rows[..., 5:7])
        features = [
            pose_features(rows),
            rows[..., 3:5] / _SIZE,
            rows[..., 5:7] / SPEED,
            rows[..., 8:],
            one_hot(rows[..., 7], len(ActorKind)),
            along_route(seen),
        ]
        tokens: Tensor = self.encode(torch.cat(features, dim=-1), rows[..., 8], seen)
        return tokens


class SignalEncoder(nn.Module):
    """Stop lines with what they ask for, told or seen."""

    def __init__(self, config: PlannerConfig) -> None:
        super().__init__()
        self.encode = RowEncoder(
            9 + ROUTE_COLUMNS,
            config.width,
            each=config.each_row,
            next_row=config.next_row,
            same_way=True,
        )

    def forward(self, rows: Tensor, routing: Tensor) -> Tensor:
        """(B, K, 8) with the columns of `Seen.signals` to (B, N, width)."""
        seen = on_route(routing, rows[..., :3])
        features = [pose_features(rows), rows[..., 3:], along_route(seen)]
        tokens: Tensor = self.encode(torch.cat(features, dim=-1), rows[..., 7], seen)
        return tokens


def signals_of_lights(lights: Tensor) -> Tensor:
    """(B, K, 5) rows of the prompt's lights with the columns of `Seen.signals`."""
    states = (LightState.RED, LightState.YELLOW, LightState.GREEN)
    shows = [(lights[..., 3] == state).float() for state in states]
    return torch.cat(
        [lights[..., :3], torch.stack([*shows, torch.zeros_like(shows[0])], -1), lights[..., 4:]],
        dim=-1,
    )


def signals_of_signs(signs: Tensor) -> Tensor:
    """(B, K, 4) rows of the prompt's stop signs with the columns of `Seen.signals`."""
    no_light = torch.zeros_like(signs[..., :3])
    return torch.cat([signs[..., :3], no_light, signs[..., 3:], signs[..., 3:]], dim=-1)


class MapEncoder(nn.Module):
    """Polylines, each as a whole: its points in order, and the route's view of its middle."""

    def __init__(self, width: int, *, each: bool) -> None:
        super().__init__()
        inputs = 3 * POINTS + len(MapKind) + ROUTE_COLUMNS
        self.encode = RowEncoder(inputs, width, each=each)

    def forward(self, lines: Tensor, routing: Tensor) -> Tensor:
        """(B, M, POINTS, 4) x, y, kind, valid to (B, M or 1, width)."""
        valid = lines[..., 3]  # (B, M, POINTS)
        places = lines[..., :2] * valid[..., None]
        chord = places[:, :, -1] - places[:, :, 0]
        heading = torch.atan2(chord[..., 1], chord[..., 0])
        middle = torch.cat([places[:, :, _MIDDLE], heading[..., None]], dim=-1)
        seen = on_route(routing, middle)
        features = [
            (places / METRES).flatten(2),
            valid,
            one_hot(lines[..., 2].amax(dim=-1), len(MapKind)),
            along_route(seen),
        ]
        tokens: Tensor = self.encode(torch.cat(features, dim=-1), valid.amax(dim=-1), seen)
        return tokens
