"""A U-Net: looks far by halving a map three times, and keeps places by what it had before.

Source: Ronneberger et al., U-Net, MICCAI 2015. What we changed: what comes up is added to what was
there, as in a feature pyramid, since concatenation would double the widest convolutions.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch.nn.functional as F
from torch import Tensor, nn

from agents.networks.blocks import conv_block


class UNet(nn.Module):
    """A map to one of the same size.

    Args:
        inputs: Channels of the map.
        widths: Channels at each size, the finest first; each but the first halves the map. It
            comes out with the first.
    """

    def __init__(self, inputs: int, widths: Sequence[int]) -> None:
        super().__init__()
        self.enter = conv_block(inputs, widths[0], size=1)
        self.down = nn.ModuleList()
        self.lift = nn.ModuleList()
        self.up = nn.ModuleList()
        for fine, coarse in pairwise(widths):
            self.down.append(
                nn.Sequential(conv_block(fine, coarse, stride=2), conv_block(coarse, coarse))
            )
            self.lift.append(nn.Conv2d(coarse, fine, 1))
            self.up.append(conv_block(fine, fine))

    def forward(self, x: Tensor) -> Tensor:
        """(B, inputs, X, Y) to (B, widths[0], X, Y); sides that halve evenly."""
        maps = [self.enter(x)]
        for down in self.down:
            maps.append(down(maps[-1]))
        out = maps.pop()
        levels = zip(reversed(self.lift), reversed(self.up), reversed(maps), strict=True)
        for lift, up, kept in levels:
            out = up(kept + F.interpolate(lift(out), scale_factor=2.0, mode="nearest"))
        return out
