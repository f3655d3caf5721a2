"""Planning decoder: an ego query looks at BEV and prompt tokens and says where the ego will be.

Source: the paper, section 3.3; the query-based design follows Hu et al., Planning-oriented
Autonomous Driving (UniAD), CVPR 2023.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from agents.driveinsight.config import BEV, TOKENS, PlannerConfig
from agents.networks.decoder import DecoderLayer
from agents.networks.mlp import mlp
from agents.networks.taps import Tap

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
