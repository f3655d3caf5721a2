"""Planning decoder: queries look at the tokens of all components and say where the ego will be.

Source: the paper, section 3.3; the query-based design follows Hu et al., Planning-oriented
Autonomous Driving (UniAD), CVPR 2023.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from agents.driveinsight.config import TOKENS, PlannerConfig
from agents.networks.decoder import DecoderLayer, MixingLayer
from agents.networks.mlp import mlp

_STEP_M = 2.0  # scale of the distance between two waypoints


class Planner(nn.Module):
    """Tokens to waypoints."""

    def __init__(self, config: PlannerConfig) -> None:
        super().__init__()
        self.config = config
        width = config.width
        queries = config.waypoints if config.each_waypoint else 1
        self.query = nn.Parameter(torch.randn(1, queries, width) * 0.02)
        self.kind = nn.Parameter(torch.randn(len(TOKENS), width) * 0.02)
        self.norm = nn.LayerNorm(width)
        self.mixing = nn.ModuleList(
            MixingLayer(width, config.heads) for _ in range(config.mixing_layers)
        )
        self.layers = nn.ModuleList(DecoderLayer(width, config.heads) for _ in range(config.layers))
        self.head = nn.Sequential(nn.LayerNorm(width), mlp(width, width))
        self.steps = nn.Linear(width, 2 * config.waypoints // queries)

    def forward(self, components: Sequence[Tensor]) -> Tensor:
        """Predicts.

        Args:
            components: (B, N, width) tokens of each, in the order of `TOKENS`; `bev` is left out by
                a policy without sensors.

        Returns:
            (B, waypoints, 2) x ahead, y right of the present ego [m].
        """
        kinds = self.kind[: len(components)]
        told = [tokens + kind for tokens, kind in zip(components, kinds, strict=True)]
        tokens = self.norm(torch.cat(told, dim=1))
        for layer in self.mixing:
            tokens = layer(tokens)
        query = self.query.expand(len(tokens), -1, -1)
        for layer in self.layers:
            query = layer(query, tokens)
        steps = self.steps(self.head(query)).flatten(1).unflatten(1, (-1, 2))  # (B, waypoints, 2)
        # whole in mixed precision too: of a waypoint 30 m ahead bfloat16 tells 12 cm apart
        return (steps.float() * _STEP_M).cumsum(dim=1)
