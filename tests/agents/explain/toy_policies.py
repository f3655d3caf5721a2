"""Policies whose gradients can be worked out on paper, behind the protocol."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn

from agents.explain.protocol import Anatomy


class LinearNet(nn.Module):
    """Waypoints (2, 2) that are a linear function of two tokens: one of `way`, two of `others`.

    x of a waypoint: sum(a * way); y: sum(b * others), the second waypoint twice the first.
    """

    def __init__(self) -> None:
        super().__init__()
        self.way = nn.Identity()
        self.others = nn.Identity()
        self.a = nn.Parameter(torch.tensor([3.0, 4.0]))
        self.b = nn.Parameter(torch.tensor([[1.0, 2.0], [2.0, 4.0]]))
        self.dropout = nn.Dropout(0.5)

    def forward(self, way: Tensor, others: Tensor) -> Tensor:
        x = (self.dropout(self.way(way)) * self.a).sum()  # way (1, 2)
        y = (self.others(others) * self.b).sum()  # others (1, 2, 2)
        first = torch.stack([x, y])
        return torch.stack([first, 2.0 * first])


class ToyAgent:
    """An agent around a net: all that the protocol needs, and nothing else."""

    def __init__(self, net: nn.Module, anatomy: Anatomy) -> None:
        self.model, self.anatomy = net, anatomy

    def explainable(self) -> ToyAgent:
        return self

    def waypoints(self, observation: Mapping[str, Any], memory: Any) -> Tensor:
        return self.model(**observation)
