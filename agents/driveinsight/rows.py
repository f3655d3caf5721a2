"""Rows of the world to features: what is told and what is seen go through the same encoders.

Each row is told in the ego frame, and once more as the route sees it (`networks.route_frame`).
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.networks.mlp import mlp
from agents.networks.route_frame import ROUTE_COLUMNS, along_route
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
    """Rows to tokens: one for all of them, or one for each.

    Args:
        inputs: Columns of a row.
        width: Of a token.
        each: A token a row, instead of one for all.
    """

    def __init__(self, inputs: int, width: int, *, each: bool) -> None:
        super().__init__()
        self.rows = mlp(inputs, width) if each else SetEncoder(inputs, width)
        self._each = each

    def forward(self, rows: Tensor, presence: Tensor) -> Tensor:
        """(B, K, F) and (B, K) 0..1 to (B, K or 1, width); zeros for rows that are not there."""
        if self._each:
            tokens: Tensor = self.rows(rows) * presence[:, :, None]
            return tokens
        return self.rows(rows, presence)[:, None]


class ObjectEncoder(nn.Module):
    """Vehicles and walkers, told or seen."""

    def __init__(self, width: int, *, each: bool) -> None:
        super().__init__()
        self.encode = RowEncoder(9 + len(ActorKind) + ROUTE_COLUMNS, width, each=each)

    def forward(self, rows: Tensor, routing: Tensor) -> Tensor:
        """(B, K, 9) with the columns of the prompt's obstacles to (B, K or 1, width)."""
        features = [
            pose_features(rows),
            rows[..., 3:5] / _SIZE,
            rows[..., 5:7] / SPEED,
            rows[..., 8:],
            one_hot(rows[..., 7], len(ActorKind)),
            along_route(routing, rows[..., :3], rows[..., 5:7]),
        ]
        tokens: Tensor = self.encode(torch.cat(features, dim=-1), rows[..., 8])
        return tokens


class SignalEncoder(nn.Module):
    """Stop lines with what they ask for, told or seen."""

    def __init__(self, width: int, *, each: bool) -> None:
        super().__init__()
        self.encode = RowEncoder(9 + ROUTE_COLUMNS, width, each=each)

    def forward(self, rows: Tensor, routing: Tensor) -> Tensor:
        """(B, K, 8) with the columns of `Seen.signals` to (B, K or 1, width)."""
        features = [pose_features(rows), rows[..., 3:], along_route(routing, rows[..., :3])]
        tokens: Tensor = self.encode(torch.cat(features, dim=-1), rows[..., 7])
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
        features = [
            (places / METRES).flatten(2),
            valid,
            one_hot(lines[..., 2].amax(dim=-1), len(MapKind)),
            along_route(routing, middle),
        ]
        tokens: Tensor = self.encode(torch.cat(features, dim=-1), valid.amax(dim=-1))
        return tokens
