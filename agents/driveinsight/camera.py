"""Camera encoder: ResNet with a feature pyramid, a depth for each pixel, lifted into BEV.

Source: the paper, section 3.1, "Camera Encoder".
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from agents.driveinsight.config import CameraEncoderConfig, GridConfig
from agents.driveinsight.lift import FrustumPooling
from agents.driveinsight.pyramid import FeaturePyramid
from agents.driveinsight.resnet import ResNet
from agents.networks.taps import Tap
from di_envs.sensors.camera.config import rig_of

# Of ImageNet's pixels, as published weights expect them
_MEAN = (123.675, 116.28, 103.53)
_DEVIATION = (58.395, 57.12, 57.375)


class CameraEncoder(nn.Module):
    """Images of all cameras to one BEV feature map."""

    scale: Tensor
    shift: Tensor

    def __init__(self, config: CameraEncoderConfig, grid: GridConfig) -> None:
        super().__init__()
        scale = 1.0 / torch.tensor(_DEVIATION)[:, None, None]
        self.register_buffer("scale", scale, persistent=False)
        self.register_buffer("shift", -torch.tensor(_MEAN)[:, None, None] * scale, persistent=False)
        self.backbone = ResNet(config.block, config.depths, config.width)
        self._first = {4: 0, 8: 1, 16: 2}[config.stride]
        self.pyramid = FeaturePyramid(self.backbone.channels[self._first :], config.channels)
        self.features = Tap()
        self.depth_net = nn.Conv2d(config.channels, config.depth_bins, 1)
        self.depth = Tap()
        self.pooling = FrustumPooling(rig_of(config.rig), config, grid)
        self.bev = Tap()

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Encodes the images of one moment.

        Args:
            images: (B, N, 3, H, W) RGB, 0..255, cameras in the rig's order.

        Returns:
            The BEV features (B, C, X, Y), and the depth logits (B, N, D, h, w) they were lifted by.
        """
        batch, cameras = images.shape[:2]
        flat = torch.addcmul(self.shift, images.flatten(0, 1).float(), self.scale)  # (B*N, 3, H, W)
        features = self.pyramid(self.backbone(flat)[self._first :])  # (B*N, C, h, w)
        features = self.features(features)
        logits = self.depth_net(features)  # (B*N, D, h, w)
        depth = self.depth(logits.softmax(dim=1))
        lifted = self.pooling(
            features.unflatten(0, (batch, cameras)), depth.unflatten(0, (batch, cameras))
        )
        return self.bev(lifted), logits.unflatten(0, (batch, cameras))
