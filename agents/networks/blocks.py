"""Convolutions that are normalised, and channels that are weighed by what all channels say."""

from __future__ import annotations

from torch import Tensor, nn


def conv_block(inputs: int, outputs: int, *, size: int = 3, stride: int = 1) -> nn.Sequential:
    """A convolution, normalised, with a ReLU."""
    conv = nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False)
    return nn.Sequential(conv, nn.BatchNorm2d(outputs), nn.ReLU())


class SqueezeExcitation(nn.Module):
    """Scales each channel by what the means of all channels say.

    Source: Hu et al., Squeeze-and-Excitation Networks, CVPR 2018.
    """

    def __init__(self, channels: int, squeezed: int | None = None) -> None:
        super().__init__()
        middle = squeezed or max(channels // 4, 8)
        self.weigh = nn.Sequential(
            nn.Linear(channels, middle), nn.ReLU(), nn.Linear(middle, channels), nn.Sigmoid()
        )

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, X, Y) to the same shape."""
        return x * self.weigh(x.mean(dim=(2, 3)))[:, :, None, None]
