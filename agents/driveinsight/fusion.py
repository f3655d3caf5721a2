"""Multi-modal fusion: both BEV maps to one width, concatenated, convolved, their channels weighed.

Source: the paper, section 3.2, "Multi-Modal Fusion".
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from agents.networks.blocks import SqueezeExcitation, conv_block
from agents.networks.taps import Tap


class MultiModalFusion(nn.Module):
    """The BEV maps of the sensors that there are to one."""

    def __init__(self, inputs: Sequence[int], width: int) -> None:
        super().__init__()
        self.standard = nn.ModuleList(conv_block(channels, width, size=1) for channels in inputs)
        self.mix = nn.Sequential(
            conv_block(width * len(inputs), width, size=1),
            conv_block(width, width),
            SqueezeExcitation(width),
        )
        self.bev = Tap()

    def forward(self, maps: Sequence[Tensor]) -> Tensor:
        """Maps (B, C_i, X, Y) to (B, width, X, Y)."""
        standard = [conv(features) for conv, features in zip(self.standard, maps, strict=True)]
        return self.bev(self.mix(torch.cat(standard, dim=1)))
