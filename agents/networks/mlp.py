"""Two layers, the smallest thing that is not linear."""

from __future__ import annotations

from torch import nn


def mlp(inputs: int, width: int) -> nn.Sequential:
    """Two layers."""
    return nn.Sequential(nn.Linear(inputs, width), nn.ReLU(), nn.Linear(width, width))
