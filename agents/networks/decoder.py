"""Layers in which queries look at tokens."""

from __future__ import annotations

from torch import Tensor, nn

from agents.networks.attention import Attention


class DecoderLayer(nn.Module):
    """Cross-attention and an MLP, each with a shortcut."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.norm1, self.norm2 = nn.LayerNorm(width), nn.LayerNorm(width)
        self.attention = Attention(width, heads)
        self.mix = nn.Sequential(
            nn.Linear(width, 4 * width), nn.GELU(), nn.Linear(4 * width, width)
        )

    def forward(self, query: Tensor, tokens: Tensor) -> Tensor:
        """(B, Q, width) and (B, T, width) to (B, Q, width)."""
        query = query + self.attention(self.norm1(query), tokens)
        return query + self.mix(self.norm2(query))


class MixingLayer(nn.Module):
    """Self-attention and an MLP, each with a shortcut."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.layer = DecoderLayer(width, heads)

    def forward(self, tokens: Tensor) -> Tensor:
        """(B, T, width) to the same shape."""
        mixed: Tensor = self.layer(tokens, self.layer.norm1(tokens))
        return mixed
