"""Prompt components to tokens: an encoder each, and one zero token for "not given".

A component that is not present, because training hid it or because somebody dropped it, has its
token zeroed *behind* its encoder, so both look the same to the planner, whatever the values were.
Source: the paper, section 3.3.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.networks.mlp import mlp
from agents.networks.sets import SetEncoder
from agents.networks.taps import Tap
from di_envs.prompt import COMPONENTS, ROUTING_POINTS, SPEED_HISTORY
from di_envs.town.lanes import LightState
from di_envs.town.map_chunks import MapKind
from di_envs.town.plan import RoadOption
from di_envs.world.kinds import ActorKind

_METRES = 20.0  # coordinates are divided by this
_SPEED = 10.0  # speeds [m/s] are divided by this


def _one_hot(column: Tensor, classes: int) -> Tensor:
    return F.one_hot(column.long().clamp(0, classes - 1), classes).float()


def _pose(columns: Tensor) -> Tensor:
    """(..., 3) x, y, yaw to (..., 4) scaled place, cosine and sine."""
    yaw = columns[..., 2:3]
    return torch.cat([columns[..., :2] / _METRES, yaw.cos(), yaw.sin()], dim=-1)


class CommandEncoder(nn.Module):
    """Which way at the next target point."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.embed = nn.Embedding(len(RoadOption), width)
        self.mix = mlp(width, width)

    def forward(self, command: Tensor) -> Tensor:
        return self.mix(self.embed(command.long().reshape(len(command))))


class TargetPointEncoder(nn.Module):
    """x, y, yaw of the next target point."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.mix = mlp(4, width)

    def forward(self, target: Tensor) -> Tensor:
        return self.mix(_pose(target))


class RoutingEncoder(nn.Module):
    """The next route points, in order."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.mix = nn.Sequential(nn.Linear(5 * ROUTING_POINTS, width), nn.ReLU(), mlp(width, width))

    def forward(self, routing: Tensor) -> Tensor:
        valid = routing[..., 3:]
        return self.mix((torch.cat([_pose(routing), valid], dim=-1) * valid).flatten(1))


class MapEncoder(nn.Module):
    """Polylines: points to a line, lines to one token."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.line = SetEncoder(2 + len(MapKind), width)
        self.lines = SetEncoder(width, width)

    def forward(self, lines: Tensor) -> Tensor:
        valid = lines[..., 3]  # (B, M, P)
        points = torch.cat(
            [lines[..., :2] / _METRES, _one_hot(lines[..., 2], len(MapKind))], dim=-1
        )
        return self.lines(self.line(points, valid), valid.amax(dim=-1))


class ObstacleEncoder(nn.Module):
    """Vehicles, walkers and props around."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.rows = SetEncoder(8 + len(ActorKind), width)

    def forward(self, rows: Tensor) -> Tensor:
        features = torch.cat(
            [
                _pose(rows),
                rows[..., 3:5] / 5.0,  # length and width
                rows[..., 5:7] / _SPEED,
                _one_hot(rows[..., 7], len(ActorKind)),
            ],
            dim=-1,
        )
        return self.rows(features, rows[..., 8])


class LightEncoder(nn.Module):
    """Stop lines with lights, and their states."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.rows = SetEncoder(4 + len(LightState), width)

    def forward(self, rows: Tensor) -> Tensor:
        state = _one_hot(rows[..., 3], len(LightState))
        return self.rows(torch.cat([_pose(rows), state], dim=-1), rows[..., 4])


class StopSignEncoder(nn.Module):
    """Stop lines with signs."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.rows = SetEncoder(4, width)

    def forward(self, rows: Tensor) -> Tensor:
        return self.rows(_pose(rows), rows[..., 3])


class SpeedEncoder(nn.Module):
    """Speeds, present or past."""

    def __init__(self, width: int, speeds: int) -> None:
        super().__init__()
        self.mix = mlp(speeds, width)

    def forward(self, speeds: Tensor) -> Tensor:
        return self.mix(speeds / _SPEED)


class PromptEncoder(nn.Module):
    """The prompt to one token a component, in the order of `COMPONENTS`."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.encoders = nn.ModuleDict(
            {
                "command": CommandEncoder(width),
                "target_point": TargetPointEncoder(width),
                "routing": RoutingEncoder(width),
                "map": MapEncoder(width),
                "obstacles": ObstacleEncoder(width),
                "traffic_lights": LightEncoder(width),
                "stop_signs": StopSignEncoder(width),
                "speed": SpeedEncoder(width, 1),
                "speed_history": SpeedEncoder(width, SPEED_HISTORY),
            }
        )
        self.taps = nn.ModuleDict({name: Tap() for name in COMPONENTS})

    def forward(self, prompt: Mapping[str, Tensor], present: Tensor) -> Tensor:
        """Encodes.

        Args:
            prompt: The components by name, (B, ...) each as in the observation.
            present: (B, 9) 0 or 1 in the order of `COMPONENTS`.

        Returns:
            (B, 9, width); zeros for components that are not present.
        """
        tokens = [
            self.taps[name](self.encoders[name](prompt[name]) * present[:, n, None])
            for n, name in enumerate(COMPONENTS)
        ]
        return torch.stack(tokens, dim=1)
