"""From what an environment shows to what a network takes, for one moment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from torch import Tensor

from agents.zoo.raster import true_raster
from agents.zoo.system import SystemConfig
from di_envs.prompt import COMPONENTS


def inputs_of(config: SystemConfig, observation: Mapping[str, Any]) -> dict[str, Tensor]:
    """The inputs of a system, as a batch of one.

    Args:
        config: Of the system.
        observation: Of an environment as `config.requires` asks for; for who is given a raster with
            the world's view under `world`.

    Returns:
        By name: cameras (1, 3, H, W) 0..255; `lidar` (1, P, 4); `raster` (1, C, X, Y) 0..1 and
        velocities; `odometry` (1, 3); and the prompt's components that it is told, as in the
        observation, zeros where somebody hid them.
    """
    seen = {name: _image(observation[name]) for name in config.cameras}
    if config.lidar:
        seen["lidar"] = _tensor(observation["lidar"])
    if config.odometry:
        seen["odometry"] = _tensor(observation["odometry"])
    present = np.asarray(observation["prompt_present"])
    for name in config.told:
        given = present[COMPONENTS.index(name)]
        seen[name] = _tensor(np.asarray(observation[name]) * given)
    if config.raster:
        routing = np.asarray(observation["routing"]) * present[COMPONENTS.index("routing")]
        seen["raster"] = _tensor(true_raster(observation["world"], routing))
    return seen


def _image(pixels: Any) -> Tensor:
    """(1, 3, H, W) of (H, W, 3)."""
    return torch.from_numpy(np.asarray(pixels)).permute(2, 0, 1)[None]


def _tensor(value: Any) -> Tensor:
    return torch.from_numpy(np.asarray(value))[None]
