"""Multi-head attention, its weights to be looked at."""

from __future__ import annotations

import math

from torch import Tensor, nn

from agents.networks.taps import Tap


class Attention(nn.Module):
    """Queries look at tokens."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.query, self.key = nn.Linear(width, width), nn.Linear(width, width)
        self.value, self.out = nn.Linear(width, width), nn.Linear(width, width)
        self.weights = Tap()

    def forward(self, query: Tensor, tokens: Tensor) -> Tensor:
        """(B, Q, width) and (B, T, width) to (B, Q, width)."""
        q, k, v = (
            layer(x).unflatten(2, (self.heads, -1)).transpose(1, 2)  # (B, heads, Q or T, width')
            for layer, x in ((self.query, query), (self.key, tokens), (self.value, tokens))
        )
        logits = q @ k.transpose(2, 3) / math.sqrt(q.shape[3])
        weights = self.weights(logits.softmax(dim=-1))  # (B, heads, Q, T), rows sum to 1
        return self.out((weights @ v).transpose(1, 2).flatten(2))
