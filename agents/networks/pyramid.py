"""A feature pyramid: brings maps of several scales to the finest of them.

Source: Lin et al., Feature Pyramid Networks for Object Detection, CVPR 2017, of which only the
finest level is kept, as one map is all that is lifted or fused.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch.nn.functional as F
from torch import Tensor, nn


class FeaturePyramid(nn.Module):
    """1x1 convolutions to one width, summed from coarse to fine, smoothed by a 3x3 one."""

    def __init__(self, inputs: Sequence[int], channels: int) -> None:
        super().__init__()
        self.lateral = nn.ModuleList(nn.Conv2d(count, channels, 1) for count in inputs)
        self.smooth = nn.Conv2d(channels, channels, 3, padding=1)

    def forward(self, maps: Sequence[Tensor]) -> Tensor:
        """Maps (B, C_i, H_i, W_i), finest first, to (B, C, H_0, W_0)."""
        total = self.lateral[-1](maps[-1])
        for lateral, features in zip(reversed(self.lateral[:-1]), reversed(maps[:-1]), strict=True):
            total = lateral(features) + F.interpolate(total, features.shape[-2:], mode="nearest")
        return self.smooth(total)
