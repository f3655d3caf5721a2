"""A GRU whose memory is a map: each cell is told by its neighbours.

Source: Ballas et al., Delving Deeper into Convolutional Networks for Learning Video
Representations, ICLR 2016.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn


class SpatialGru(nn.Module):
    """One step.

    Args:
        inputs: Channels of what it is told.
        width: Of what it remembers.
    """

    def __init__(self, inputs: int, width: int) -> None:
        super().__init__()
        self.gates = nn.Conv2d(inputs + width, 2 * width, 3, padding=1)
        self.new = nn.Conv2d(inputs + width, width, 3, padding=1)

    def forward(self, told: Tensor, memory: Tensor) -> Tensor:
        """(B, inputs, X, Y) and (B, width, X, Y) to the next memory."""
        update, reset = self.gates(torch.cat([told, memory], dim=1)).sigmoid().chunk(2, dim=1)
        new = self.new(torch.cat([told, reset * memory], dim=1)).tanh()
        return (1.0 - update) * memory + update * new
