"""Cameras, and a LiDAR where a system has one, to one map of the ground, and what is remembered.

By the encoders of the paper's policy. Its cameras are what that policy's have learnt, and stay so:
what makes a system itself comes after them.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from typing_extensions import Self

from agents.driveinsight.camera import ImageEncoder, image_groups
from agents.driveinsight.config import CameraEncoderConfig, LidarEncoderConfig
from agents.driveinsight.fusion import MultiModalFusion
from agents.driveinsight.lidar import LidarEncoder
from agents.driveinsight.memory import warp
from agents.driveinsight.model import Policy
from agents.explain.protocol import FeatureMap
from agents.networks.blocks import conv_block
from agents.networks.grid import GridConfig
from agents.networks.images import Standardised
from agents.networks.taps import Tap
from agents.zoo.raster import GRID
from agents.zoo.system import Seen, State, SystemConfig

# The ground of all views from above, in cells of 1 m
BEV = GridConfig(
    x_min_m=GRID.x_min_m, x_max_m=GRID.x_max_m, y_min_m=GRID.y_min_m, y_max_m=GRID.y_max_m, cells=48
)
EXTENT_M = (BEV.x_min_m, BEV.x_max_m, BEV.y_min_m, BEV.y_max_m)
_IMAGES = CameraEncoderConfig()
CHANNELS = _IMAGES.channels  # of a map of the ground


class BevEyes(nn.Module):
    """The sensors of a system to a map of the ground.

    Args:
        config: Of the system.
    """

    def __init__(self, config: SystemConfig) -> None:
        super().__init__()
        self.standard = Standardised()
        self.groups = image_groups(config.rig)
        self.views = nn.ModuleList(ImageEncoder(group, _IMAGES, BEV) for group in self.groups)
        points = LidarEncoderConfig(channels=CHANNELS)
        self.lidar = LidarEncoder(points, BEV) if config.lidar else None
        self.fusion = MultiModalFusion([CHANNELS] * (1 + bool(config.lidar)), CHANNELS)
        self.bev = Tap()

    def forward(self, seen: Seen) -> tuple[Tensor, Tensor]:
        """Sees.

        Returns:
            (B, CHANNELS, X, Y) on `BEV`; and (B, CHANNELS) what the first camera shows, as a whole.
        """
        lifted, ahead = list[Tensor](), list[Tensor]()
        for group, view in zip(self.groups, self.views, strict=True):
            images = torch.stack([seen[camera.name] for camera in group], dim=1)
            bev, _, (_, first) = view(self.standard(images))
            lifted.append(bev)
            ahead.append(first.mean(dim=(2, 3)))
        maps = [torch.stack(lifted).sum(dim=0)]
        if self.lidar is not None:
            maps.append(self.lidar(seen["lidar"]))
        return self.bev(self.fusion(maps)), ahead[0]

    def learnt_by(self, policy: Policy) -> None:
        """Takes over what another policy's cameras have learnt; they learn no more.

        Its rig is of the same sizes.
        """
        assert policy.perception is not None, "it has no eyes"
        assert policy.perception.camera is not None, "it has no cameras"
        self.views.load_state_dict(policy.perception.camera.views.state_dict())
        self.views.requires_grad_(False)

    def train(self, mode: bool = True) -> Self:
        """All but cameras that learn no more: their norms stay as they are, too."""
        super().train(mode)
        self.views.train(mode and any(each.requires_grad for each in self.views.parameters()))
        return self

    def maps(self, path: str) -> dict[str, FeatureMap]:
        """Its maps, for an anatomy; the module's dotted path is `path`."""
        found = {"bev": FeatureMap(tap=f"{path}.bev", extent_m=EXTENT_M)}
        for number, group in enumerate(self.groups):
            for item, camera in enumerate(group):
                tap = f"{path}.views.{number}.features"
                found[camera.name] = FeatureMap(tap=tap, item=item, camera=camera.name)
        return found


class Recall(nn.Module):
    """The map of the moment before, brought to where the ego is now, beside the present one.

    Args:
        recurrent: Whether what was joined is remembered, and not what was seen alone.
    """

    def __init__(self, *, recurrent: bool) -> None:
        super().__init__()
        self.join = conv_block(2 * CHANNELS, CHANNELS)
        self.recurrent = recurrent

    def forward(self, bev: Tensor, pose: Tensor, state: State | None) -> tuple[Tensor, State]:
        """(B, C, X, Y) seen at (B, 3) odometry, to the same shape, and what is remembered."""
        before = torch.zeros_like(bev) if state is None else warp(state[0], state[1], pose, BEV)
        joined: Tensor = self.join(torch.cat([bev, before], dim=1))
        return joined, (joined if self.recurrent else bev, pose)
