"""Multi-modal fusion: both BEV maps to one width, concatenated, convolved, their channels weighed.

Source: the paper, section 3.2, "Multi-Modal Fusion"; Hu et al., Squeeze-and-Excitation Networks,
CVPR 2018.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from agents.networks.taps import Tap


class SqueezeExcitation(nn.Module):
    """Scales each channel by what the means of all channels say."""

    def __init__(self, channels: int, squeezed: int | None = None) -> None:
        super().__init__()
        middle = squeezed or max(channels // 4, 8)
        self.weigh = nn.Sequential(
            nn.Linear(channels, middle), nn.ReLU(), nn.Linear(middle, channels), nn.Sigmoid()
        )

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, X, Y) to the same shape."""
        return x * self.weigh(x.mean(dim=(2, 3)))[:, :, None, None]


def conv_block(inputs: int, outputs: int) -> nn.Sequential:
    """A 3x3 convolution, normalised, with a ReLU."""
    conv = nn.Conv2d(inputs, outputs, 3, padding=1, bias=False)
    return nn.Sequential(conv, nn.BatchNorm2d(outputs), nn.ReLU())


class MultiModalFusion(nn.Module):
    """The BEV maps of the sensors that there are to one."""

    def __init__(self, inputs: Sequence[int], width: int) -> None:
        super().__init__()
        self.standard = nn.ModuleList(conv_block(channels, width) for channels in inputs)
        self.mix = nn.Sequential(
            conv_block(width * len(inputs), width),
            SqueezeExcitation(width),
            conv_block(width, width),
            SqueezeExcitation(width),
        )
        self.bev = Tap()

    def forward(self, maps: Sequence[Tensor]) -> Tensor:
        """Maps (B, C_i, X, Y) to (B, width, X, Y)."""
        standard = [conv(features) for conv, features in zip(self.standard, maps, strict=True)]
        return self.bev(self.mix(torch.cat(standard, dim=1)))
