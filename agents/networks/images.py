"""Pixels to numbers about 0."""

from __future__ import annotations

import torch
from torch import Tensor, nn

_MIDDLE, _SPREAD = 120.0, 60.0
# Of each colour in the pictures of ImageNet, as published weights want them
_MEAN = (123.675, 116.28, 103.53)
_DEVIATION = (58.395, 57.12, 57.375)


def normalised(images: Tensor) -> Tensor:
    """(B, 3, H, W) of 0..255 to real numbers, most of them within -2..2."""
    return (images.float() - _MIDDLE) / _SPREAD


class Standardised(nn.Module):
    """Each colour by its own mean and deviation."""

    scale: Tensor
    shift: Tensor

    def __init__(self) -> None:
        super().__init__()
        scale = 1.0 / torch.tensor(_DEVIATION)[:, None, None]
        self.register_buffer("scale", scale, persistent=False)
        self.register_buffer("shift", -torch.tensor(_MEAN)[:, None, None] * scale, persistent=False)

    def forward(self, images: Tensor) -> Tensor:
        """(..., 3, H, W) of 0..255 to real numbers, most of them within -2..2."""
        return torch.addcmul(self.shift, images.float(), self.scale)
