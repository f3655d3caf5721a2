"""Prompt components to tokens: an encoder each, and zero tokens for "not given".

A component that is not present, because training hid it or because somebody dropped it, has its
tokens zeroed *behind* its encoder, so both look the same to the planner, whatever the values were.
Where the route is not given, the other components' rows are not told along it either.
Source: the paper, section 3.3.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from agents.driveinsight.config import PlannerConfig
from agents.driveinsight.rows import (
    SPEED,
    MapEncoder,
    ObjectEncoder,
    SignalEncoder,
    pose_features,
    signals_of_lights,
    signals_of_signs,
)
from agents.networks.mlp import mlp
from agents.networks.taps import Tap
from di_envs.prompt import COMPONENTS, ROUTING_POINTS, SPEED_HISTORY
from di_envs.town.plan import RoadOption


class CommandEncoder(nn.Module):
    """Which way at the next target point."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.embed = nn.Embedding(len(RoadOption), width)
        self.mix = mlp(width, width)

    def forward(self, command: Tensor) -> Tensor:
        """(B,) or (B, 1) to (B, 1, width)."""
        return self.mix(self.embed(command.long().reshape(len(command), 1)))


class TargetPointEncoder(nn.Module):
    """x, y, yaw of the next target point."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.mix = mlp(4, width)

    def forward(self, target: Tensor) -> Tensor:
        """(B, 3) to (B, 1, width)."""
        return self.mix(pose_features(target))[:, None]


class RoutingEncoder(nn.Module):
    """The next route points, in order."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.mix = nn.Sequential(nn.Linear(5 * ROUTING_POINTS, width), nn.ReLU(), mlp(width, width))

    def forward(self, routing: Tensor) -> Tensor:
        """(B, ROUTING_POINTS, 4) to (B, 1, width)."""
        valid = routing[..., 3:]
        points = torch.cat([pose_features(routing), valid], dim=-1) * valid
        return self.mix(points.flatten(1))[:, None]


class SpeedEncoder(nn.Module):
    """Speeds, present or past."""

    def __init__(self, width: int, speeds: int) -> None:
        super().__init__()
        self.mix = mlp(speeds, width)

    def forward(self, speeds: Tensor) -> Tensor:
        """(B, speeds) to (B, 1, width)."""
        return self.mix(speeds / SPEED)[:, None]


class PromptEncoder(nn.Module):
    """The prompt to tokens by component, in the order of `COMPONENTS`."""

    def __init__(self, config: PlannerConfig) -> None:
        super().__init__()
        width = config.width
        self.command = CommandEncoder(width)
        self.target_point = TargetPointEncoder(width)
        self.routing = RoutingEncoder(width)
        self.map = MapEncoder(width, each=False)
        self.objects = ObjectEncoder(config)
        self.signals = SignalEncoder(config)
        self.speed = SpeedEncoder(width, 1)
        self.speed_history = SpeedEncoder(width, SPEED_HISTORY)
        self.taps = nn.ModuleDict({name: Tap() for name in COMPONENTS})

    def forward(self, prompt: Mapping[str, Tensor], present: Tensor) -> list[Tensor]:
        """Encodes.

        Args:
            prompt: The components by name, (B, ...) each as in the observation.
            present: (B, 9) 0 or 1 in the order of `COMPONENTS`.

        Returns:
            (B, N, width) for each component; zeros for those that are not present.
        """
        route = told_route(prompt, present)
        tokens = (
            self.command(prompt["command"]),
            self.target_point(prompt["target_point"]),
            self.routing(prompt["routing"]),
            self.map(prompt["map"], route),
            self.objects(prompt["obstacles"], route),
            self.signals(signals_of_lights(prompt["traffic_lights"]), route),
            self.signals(signals_of_signs(prompt["stop_signs"]), route),
            self.speed(prompt["speed"]),
            self.speed_history(prompt["speed_history"]),
        )
        return [
            self.taps[name](rows * present[:, n, None, None])
            for n, (name, rows) in enumerate(zip(COMPONENTS, tokens, strict=True))
        ]


def told_route(prompt: Mapping[str, Tensor], present: Tensor) -> Tensor:
    """(B, ROUTING_POINTS, 4) the route, without a point where it is not given."""
    given: Tensor = prompt["routing"] * present[:, COMPONENTS.index("routing"), None, None]
    return given
