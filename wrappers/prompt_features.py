"""What a small policy reads of the prompt: the road ahead, and who and what lies on it.

Stable-Baselines3's own extractor for `Dict` observations strings all numbers together as they are,
metres and radians and empty rows alike, and learns little from that. This one takes them scaled,
each obstacle, light and stop sign with its place along the route (`di_envs.prompt_numbers`), reads
all rows of a table with the same small network, and keeps the largest of what they say. The order
of the rows then does not matter, and empty ones say nothing (Qi et al., PointNet, CVPR 2017).

It reads the prompt's own entries, or, for less time, the vector of `preset="flat"`: there the
environment has worked out the numbers once for all worlds, and not each time that a network learns
from them. Both are the same policy to the same weights.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from di_envs.prompt_numbers import (
    FLAT_NUMBERS,
    KEYS,
    ROUTE_SAMPLES,
    PromptNumbers,
    numbers_of,
    prompt_numbers,
)


class PromptFeatures(BaseFeaturesExtractor):
    """Turns the prompt, (B, …) tables in the ego frame, into (B, features) for a policy.

    Use it as `policy_kwargs={"features_extractor_class": PromptFeatures}`: with `MlpPolicy` on
    `preset="flat"`, or with `MultiInputPolicy`.
    """

    def __init__(self, observation_space: spaces.Space[Any], width: int = 32) -> None:
        """Makes the small networks.

        Args:
            observation_space: The vector of the prompt alone with `preset="flat"`, or a `Dict` with
                the entries `KEYS`, of which others are not read.
            width: How many numbers each table is summed up in.

        Raises:
            ValueError: If it is neither.
        """
        if isinstance(observation_space, spaces.Dict):
            missing = [key for key in KEYS if key not in observation_space.spaces]
            if missing:
                raise ValueError(
                    f"PromptFeatures reads {', '.join(KEYS)}; {', '.join(missing)} missing."
                )
        elif observation_space.shape != (FLAT_NUMBERS,):
            raise ValueError(
                f"PromptFeatures reads a vector of {FLAT_NUMBERS} numbers, which is what the group "
                f"'prompt' alone gives with preset='flat'; got {observation_space}."
            )
        straight = 7 + 4 + 5 + 4 * len(ROUTE_SAMPLES)
        super().__init__(observation_space, features_dim=straight + 3 * width)
        self.obstacles = _rows(6 + 4 + 1, width)
        self.lights = _rows(6 + 3, width)
        self.signs = _rows(6, width)

    def forward(self, observations: Tensor | Mapping[str, Tensor]) -> Tensor:
        """(B, features)."""
        numbers = _numbers(observations)
        parts = [
            numbers.straight,
            _pooled(self.obstacles(numbers.obstacles), numbers.obstacles_valid),
            _pooled(self.lights(numbers.lights), numbers.lights_valid),
            _pooled(self.signs(numbers.signs), numbers.signs_valid),
        ]
        return torch.cat(parts, dim=1)


def _numbers(observations: Tensor | Mapping[str, Tensor]) -> PromptNumbers:
    """The prompt's numbers: taken apart where they were laid out, else worked out."""
    if isinstance(observations, Tensor):
        return numbers_of(observations)
    command = observations["command"].flatten(1)  # (B, 7) of (B, 1, 7), where SB3 made it
    return prompt_numbers({**observations, "command": command}, torch)


def _rows(inputs: int, width: int) -> nn.Module:
    return nn.Sequential(nn.Linear(inputs, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU())


def _pooled(rows: Tensor, valid: Tensor) -> Tensor:
    """(B, K, F) and (B, K, 1) to (B, F): the largest over the valid rows, 0 where there is none."""
    pooled: Any = (rows * valid).amax(dim=1)
    return pooled


__all__ = ["KEYS", "PromptFeatures"]
