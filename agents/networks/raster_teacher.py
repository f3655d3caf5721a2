"""A teacher that reads the true view from above: convolutions, and a few numbers joined to them.

Source: Zhang et al., End-to-End Urban Driving by Imitating a Reinforcement Learning Coach (Roach),
ICCV 2021. What we changed: an action is a value and not a distribution, as it is learnt from what
the expert did; beside it stand waypoints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from agents.networks.mlp import mlp
from agents.networks.taps import Tap
from agents.networks.waypoint_heads import StepsHead

STATES = 1  # numbers beside the view: the speed


@dataclass(frozen=True, kw_only=True)
class TeacherOutput:
    """What a teacher says, and what it was thinking.

    Attributes:
        features: (B, C_i, X_i, Y_i) behind each convolution, the finest first.
        latent: (B, width) in which view and state are joined.
        action: (B, 2) throttle less brake, and steer, both -1..1.
        waypoints: (B, T, 2) [m].
    """

    features: tuple[Tensor, ...]
    latent: Tensor
    action: Tensor
    waypoints: Tensor


class RasterTeacher(nn.Module):
    """The view from above and the speed to an action and waypoints.

    Args:
        inputs: Channels of the view.
        cells: Of it, along each side.
        widths: Channels of the convolutions; each halves the view.
        width: Of what view and state are joined in.
        waypoints: How many.
    """

    def __init__(
        self, inputs: int, cells: int, widths: Sequence[int], width: int, waypoints: int
    ) -> None:
        super().__init__()
        self.convs, self.taps = nn.ModuleList(), nn.ModuleList()
        before, side = inputs, cells
        for number, channels in enumerate(widths):
            size = 5 if number < 3 else 3
            conv = nn.Conv2d(before, channels, size, 2, size // 2)
            nn.init.kaiming_normal_(conv.weight, nonlinearity="relu")  # no norms keep it going
            self.convs.append(conv)
            self.taps.append(Tap())
            before, side = channels, -(-side // 2)
        self.view = nn.Sequential(nn.Linear(before * side * side, width), nn.ReLU())
        self.state = nn.Sequential(mlp(STATES, width), nn.ReLU())
        self.speed = Tap()
        self.join = nn.Sequential(nn.Linear(2 * width, width), nn.ReLU())
        self.action = nn.Sequential(mlp(width, width), nn.ReLU(), nn.Linear(width, 2), nn.Tanh())
        self.plan = StepsHead(width, waypoints)

    def forward(self, raster: Tensor, state: Tensor) -> TeacherOutput:
        """Looks.

        Args:
            raster: (B, inputs, cells, cells).
            state: (B, STATES) the speed, in tens of metres a second.
        """
        x, features = raster, list[Tensor]()
        for conv, tap in zip(self.convs, self.taps, strict=True):
            x = tap(conv(x).relu())
            features.append(x)
        latent = self.join(torch.cat([self.view(x.flatten(1)), self.speed(self.state(state))], 1))
        return TeacherOutput(
            features=tuple(features),
            latent=latent,
            action=self.action(latent),
            waypoints=self.plan(latent),
        )
