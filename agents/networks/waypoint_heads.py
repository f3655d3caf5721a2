"""Heads that say waypoints: all steps at once, or each from where the one before led."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from agents.networks.mlp import mlp

STEP_M = 2.0  # scale of the distance between two waypoints
_METRES = 20.0  # places that go into a network are divided by this


class StepsHead(nn.Module):
    """A vector to the steps between waypoints, all at once."""

    def __init__(self, width: int, waypoints: int) -> None:
        super().__init__()
        self.steps = nn.Sequential(mlp(width, width), nn.ReLU(), nn.Linear(width, 2 * waypoints))

    def forward(self, latent: Tensor) -> Tensor:
        """(B, width) to (B, T, 2) x ahead, y right [m]."""
        steps = self.steps(latent).unflatten(1, (-1, 2))
        return (steps.float() * STEP_M).cumsum(dim=1)


class GruHead(nn.Module):
    """A vector to waypoints: a GRU that is told where it has come to, and where it is to go.

    Source: Filos et al., Can Autonomous Vehicles Identify, Recover From, and Adapt to Distribution
    Shifts?, ICML 2020, as TransFuser (CVPR 2021) uses it: the place and the target point, as a sum,
    go in at each step.
    """

    def __init__(self, width: int, waypoints: int) -> None:
        super().__init__()
        self.waypoints = waypoints
        self.cell = nn.GRUCell(2, width)
        self.step = nn.Linear(width, 2)

    def forward(self, latent: Tensor, target: Tensor) -> Tensor:
        """Plans.

        Args:
            latent: (B, width) that the GRU begins with.
            target: (B, 2) x, y of the target point [m].

        Returns:
            (B, T, 2) x ahead, y right [m].
        """
        place, places = torch.zeros_like(target), list[Tensor]()
        for _ in range(self.waypoints):
            latent = self.cell((place + target) / _METRES, latent)
            place = place + STEP_M * self.step(latent)
            places.append(place)
        return torch.stack(places, dim=1)
