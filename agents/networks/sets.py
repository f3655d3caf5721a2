"""Sets of rows to one token: in any order, some of them empty."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.networks.mlp import mlp


class SetEncoder(nn.Module):
    """Encodes each row, then takes the largest and the mean over those that are there."""

    def __init__(self, inputs: int, width: int) -> None:
        super().__init__()
        self.row = mlp(inputs, width)
        self.join = nn.Linear(2 * width, width)

    def forward(self, rows: Tensor, presence: Tensor) -> Tensor:
        """(..., K, F) rows and (..., K) 0..1 to (..., width); pools zeros where none is."""
        mask = presence[..., None]
        encoded = F.relu(self.row(rows)) * mask
        largest = encoded.amax(dim=-2)  # ReLU: a row that is not there is below any other
        mean = encoded.sum(dim=-2) / mask.sum(dim=-2).clamp(min=1.0)
        return self.join(torch.cat([largest, mean], dim=-1))
