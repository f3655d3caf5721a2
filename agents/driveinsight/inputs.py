"""From what an environment shows to what the network takes, for one moment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from agents.driveinsight.camera import image_groups
from agents.driveinsight.config import PolicyConfig
from agents.driveinsight.model import Inputs
from di_envs.prompt import COMPONENTS
from di_envs.sensors.camera.config import CameraConfig, rig_of


def inputs_of(config: PolicyConfig, observation: Mapping[str, Any]) -> Inputs:
    """The inputs of a policy, as a batch of one; BEV features are always present.

    Args:
        config: Of the policy.
        observation: With the groups that `config.observations` names.
    """
    present = torch.cat([_tensor(observation["prompt_present"]).float(), torch.ones(1, 1)], dim=1)
    images: tuple[Tensor, ...] = ()
    points = pose = None
    if config.camera is not None:
        groups = image_groups(rig_of(config.camera.rig))
        images = tuple(_images(group, observation) for group in groups)
    if config.lidar is not None:
        points = _tensor(observation["lidar"])
    if "odometry" in config.observations:
        pose = _tensor(observation["odometry"])
    prompt = {name: _tensor(observation[name]) for name in COMPONENTS}
    return Inputs(prompt=prompt, present=present, images=images, points=points, pose=pose)


def _images(group: Sequence[CameraConfig], observation: Mapping[str, Any]) -> Tensor:
    """(1, N, 3, H, W) of the cameras of one size."""
    stacked = np.stack([observation[camera.name] for camera in group])  # (N, H, W, 3)
    return torch.from_numpy(stacked).permute(0, 3, 1, 2)[None]


def _tensor(value: Any) -> Tensor:
    return torch.from_numpy(np.asarray(value))[None]
