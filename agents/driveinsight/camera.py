"""Camera encoder: ResNet with a feature pyramid, a depth for each pixel, lifted into BEV.

Source: the paper, section 3.1, "Camera Encoder".
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.driveinsight.config import CameraEncoderConfig
from agents.networks.grid import GridConfig
from agents.networks.images import Standardised
from agents.networks.lift import FrustumPooling, growing_depths_m
from agents.networks.pyramid import FeaturePyramid
from agents.networks.resnet import ResNet
from agents.networks.taps import Tap
from di_envs.sensors.camera.config import CameraConfig, Rig, rig_of


def image_groups(rig: Rig) -> tuple[tuple[CameraConfig, ...], ...]:
    """A rig's cameras, those of one size together, in the rig's order."""
    sizes = list(dict.fromkeys((each.height, each.width) for each in rig.cameras))
    return tuple(
        tuple(each for each in rig.cameras if (each.height, each.width) == size) for size in sizes
    )


def depths_of(config: CameraEncoderConfig) -> NDArray[np.float64]:
    """(D,) distances ahead of a camera that a pixel may lie at."""
    return growing_depths_m(config.nearest_m, config.farthest_m, config.depth_bins)


class ImageEncoder(nn.Module):
    """Images of one size to BEV features."""

    def __init__(
        self, cameras: Sequence[CameraConfig], config: CameraEncoderConfig, grid: GridConfig
    ) -> None:
        super().__init__()
        self.backbone = ResNet(config.block, config.depths, config.width)
        self._first = {4: 0, 8: 1, 16: 2}[config.stride]
        self.pyramid = FeaturePyramid(self.backbone.channels[self._first :], config.channels)
        self.features = Tap()
        self.depth_net = nn.Conv2d(config.channels, config.depth_bins, 1)
        self.depth = Tap()
        self.pooling = FrustumPooling(cameras, config.stride, depths_of(config), grid)

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor, tuple[Tensor, Tensor]]:
        """Encodes normalised images.

        Args:
            images: (B, N, 3, H, W).

        Returns:
            BEV features (B, C, X, Y); depth logits (B, N, D, h, w); and of the first camera the
            features (B, C', H/4, W/4) and (B, C, h, w).
        """
        batch, cameras = images.shape[:2]
        maps = self.backbone(images.flatten(0, 1))  # (B*N, C', H/4, W/4), …
        features = self.features(self.pyramid(maps[self._first :]))  # (B*N, C, h, w)
        logits = self.depth_net(features)  # (B*N, D, h, w)
        depth = self.depth(logits.softmax(dim=1))
        lifted = self.pooling(
            features.unflatten(0, (batch, cameras)), depth.unflatten(0, (batch, cameras))
        )
        first = maps[0][::cameras], features[::cameras]
        return lifted, logits.unflatten(0, (batch, cameras)), first


class CameraEncoder(nn.Module):
    """Images of all cameras to one BEV feature map."""

    def __init__(self, config: CameraEncoderConfig, grid: GridConfig) -> None:
        super().__init__()
        self.standard = Standardised()
        groups = image_groups(rig_of(config.rig))
        self.views = nn.ModuleList(ImageEncoder(group, config, grid) for group in groups)
        # in which a lamp is largest
        self._sharpest = max(range(len(groups)), key=lambda n: groups[n][0].focal_px)
        self.bev = Tap()

    def forward(
        self, images: Sequence[Tensor]
    ) -> tuple[Tensor, tuple[Tensor, ...], tuple[Tensor, Tensor]]:
        """Encodes the images of one moment.

        Args:
            images: For each size of image (B, N, 3, H, W) RGB, 0..255, in the order of
                `image_groups`.

        Returns:
            BEV features (B, C, X, Y); for each size the depth logits (B, N, D, h, w) they were
            lifted by; and features of the camera that sees lamps best, fine and deep, see
            `ImageEncoder`.
        """
        views = [view(self.standard(group)) for view, group in zip(self.views, images, strict=True)]
        # not stacked: each map keeps its channels last, as convolutions want them
        lifted = functools.reduce(torch.add, (view[0] for view in views))
        return self.bev(lifted), tuple(view[1] for view in views), views[self._sharpest][2]
