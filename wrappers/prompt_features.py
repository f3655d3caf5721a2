"""What a small policy reads of the prompt: the road ahead, and who and what lies on it.

Stable-Baselines3's own extractor for `Dict` observations strings all numbers together as they are,
metres and radians and empty rows alike, and learns little from that. This one takes them scaled,
each obstacle, light and stop sign with its place along the route (`di_envs.prompt_numbers`), reads
all rows of a table with the same small network, and keeps the largest of what they say. The order
of the rows then does not matter, and empty ones say nothing (Qi et al., PointNet, CVPR 2017).
"""

from __future__ import annotations

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from di_envs.prompt_numbers import KEYS, ROUTE_SAMPLES, prompt_numbers


class PromptFeatures(BaseFeaturesExtractor):
    """Turns the prompt, (B, …) tables in the ego frame, into (B, features) for a policy.

    Use it as `policy_kwargs={"features_extractor_class": PromptFeatures}` with `MultiInputPolicy`.
    """

    def __init__(self, observation_space: spaces.Dict, width: int = 32) -> None:
        """Makes the small networks.

        Args:
            observation_space: A `Dict` with the entries `KEYS`, others are not read.
            width: How many numbers each table is summed up in.
        """
        missing = [key for key in KEYS if key not in observation_space.spaces]
        if missing:
            raise ValueError(
                f"PromptFeatures reads {', '.join(KEYS)}; {', '.join(missing)} missing."
            )
        straight = 7 + 4 + 5 + 4 * len(ROUTE_SAMPLES)
        super().__init__(observation_space, features_dim=straight + 3 * width)
        self.obstacles = _rows(6 + 4 + 1, width)
        self.lights = _rows(6 + 3, width)
        self.signs = _rows(6, width)

    def forward(self, observations: dict[str, Tensor]) -> Tensor:
        """(B, features)."""
        command = observations["command"].flatten(1)  # (B, 7) of (B, 1, 7), where SB3 made it
        numbers = prompt_numbers({**observations, "command": command}, torch)
        parts = [
            numbers.straight,
            _pooled(self.obstacles(numbers.obstacles), numbers.obstacles_valid),
            _pooled(self.lights(numbers.lights), numbers.lights_valid),
            _pooled(self.signs(numbers.signs), numbers.signs_valid),
        ]
        return torch.cat(parts, dim=1)


def _rows(inputs: int, width: int) -> nn.Module:
    return nn.Sequential(nn.Linear(inputs, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU())


def _pooled(rows: Tensor, valid: Tensor) -> Tensor:
    """(B, K, F) and (B, K, 1) to (B, F): the largest over the valid rows, 0 where there is none."""
    pooled: Any = (rows * valid).amax(dim=1)
    return pooled


__all__ = ["KEYS", "PromptFeatures"]
