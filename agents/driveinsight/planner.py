"""Planning decoder: an ego query looks at BEV and prompt tokens and says where the ego will be.

Source: the paper, section 3.3; the query-based design follows Hu et al., Planning-oriented
Autonomous Driving (UniAD), CVPR 2023.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from agents.driveinsight.config import BEV, TOKENS, PlannerConfig
from agents.driveinsight.taps import Tap
from agents.driveinsight.tokens import mlp

_STEP_M = 2.0  # scale of the distance between two waypoints


class BevTokens(nn.Module):
    """A BEV map to tokens: patches of cells, encoded by an MLP, their places told apart."""

    def __init__(self, channels: int, cells: int, config: PlannerConfig) -> None:
        super().__init__()
        patch = cells // config.bev_tokens
        if patch * config.bev_tokens != cells:
            raise ValueError(f"{cells} cells do not make {config.bev_tokens} tokens a side")
        self.patches = nn.Conv2d(channels, config.width, patch, patch)
        self.mix = mlp(config.width, config.width)
        self.place = nn.Parameter(torch.randn(config.bev_tokens**2, config.width) * 0.02)
        self.tokens = Tap()

    def forward(self, bev: Tensor, present: Tensor) -> Tensor:
        """(B, C, X, Y) and (B,) 0 or 1 to (B, T, width) before their places are added."""
        tokens = self.mix(self.patches(bev).flatten(2).transpose(1, 2))  # (B, T, width)
        return self.tokens(tokens * present[:, None, None])


class CrossAttention(nn.Module):
    """Multi-head attention of queries to tokens, its weights to be looked at."""

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


class DecoderLayer(nn.Module):
    """Cross-attention and an MLP, each with a shortcut."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.norm1, self.norm2 = nn.LayerNorm(width), nn.LayerNorm(width)
        self.attention = CrossAttention(width, heads)
        self.mix = nn.Sequential(
            nn.Linear(width, 4 * width), nn.GELU(), nn.Linear(4 * width, width)
        )

    def forward(self, query: Tensor, tokens: Tensor) -> Tensor:
        query = query + self.attention(self.norm1(query), tokens)
        return query + self.mix(self.norm2(query))


class Planner(nn.Module):
    """Tokens to waypoints."""

    def __init__(self, config: PlannerConfig) -> None:
        super().__init__()
        self.config = config
        self.query = nn.Parameter(torch.randn(1, 1, config.width) * 0.02)
        self.kind = nn.Parameter(torch.randn(len(TOKENS), config.width) * 0.02)
        self.norm = nn.LayerNorm(config.width)
        self.layers = nn.ModuleList(
            DecoderLayer(config.width, config.heads) for _ in range(config.layers)
        )
        self.head = nn.Sequential(nn.LayerNorm(config.width), mlp(config.width, config.width))
        self.steps = nn.Linear(config.width, 2 * config.waypoints)

    def forward(self, prompt: Tensor, bev: Tensor | None, place: Tensor | None) -> Tensor:
        """Predicts.

        Args:
            prompt: (B, 9, width) tokens.
            bev: (B, T, width) tokens; None for a policy without sensors.
            place: (T, width) what tells BEV tokens apart.

        Returns:
            (B, waypoints, 2) x ahead, y right of the present ego [m].
        """
        tokens = prompt + self.kind[:-1]
        if bev is not None and place is not None:
            tokens = torch.cat([tokens, bev + place + self.kind[TOKENS.index(BEV)]], dim=1)
        tokens = self.norm(tokens)
        query = self.query.expand(len(prompt), -1, -1)
        for layer in self.layers:
            query = layer(query, tokens)
        steps = self.steps(self.head(query[:, 0])).unflatten(1, (-1, 2))  # (B, waypoints, 2)
        # whole in mixed precision too: of a waypoint 30 m ahead bfloat16 tells 12 cm apart
        return (steps.float() * _STEP_M).cumsum(dim=1)
