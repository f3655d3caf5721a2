"""A ResNet whose parameters are named as timm's and torchvision's, so published weights load.

Source: He et al., Deep Residual Learning for Image Recognition, CVPR 2016; written from the paper,
with the stride of a bottleneck in its 3x3 convolution as both libraries have it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch.nn.functional as F
from torch import Tensor, nn


def _conv(inputs: int, outputs: int, size: int = 3, stride: int = 1) -> nn.Conv2d:
    return nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False)


def _shortcut(inputs: int, outputs: int, stride: int) -> nn.Module | None:
    """What brings a block's input to its output's shape; None where it has it."""
    if stride == 1 and inputs == outputs:
        return None
    return nn.Sequential(_conv(inputs, outputs, 1, stride), nn.BatchNorm2d(outputs))


class BasicBlock(nn.Module):
    """Two 3x3 convolutions and a shortcut."""

    expansion = 1

    def __init__(self, inputs: int, width: int, stride: int) -> None:
        super().__init__()
        self.conv1, self.bn1 = _conv(inputs, width, 3, stride), nn.BatchNorm2d(width)
        self.conv2, self.bn2 = _conv(width, width), nn.BatchNorm2d(width)
        self.downsample = _shortcut(inputs, width, stride)

    def forward(self, x: Tensor) -> Tensor:
        shortcut = x if self.downsample is None else self.downsample(x)
        x = F.relu(self.bn1(self.conv1(x)))
        return F.relu(self.bn2(self.conv2(x)) + shortcut)


class Bottleneck(nn.Module):
    """A 3x3 convolution between two 1x1 ones, and a shortcut."""

    expansion = 4

    def __init__(self, inputs: int, width: int, stride: int) -> None:
        super().__init__()
        outputs = width * self.expansion
        self.conv1, self.bn1 = _conv(inputs, width, 1), nn.BatchNorm2d(width)
        self.conv2, self.bn2 = _conv(width, width, 3, stride), nn.BatchNorm2d(width)
        self.conv3, self.bn3 = _conv(width, outputs, 1), nn.BatchNorm2d(outputs)
        self.downsample = _shortcut(inputs, outputs, stride)

    def forward(self, x: Tensor) -> Tensor:
        shortcut = x if self.downsample is None else self.downsample(x)
        x = F.relu(self.bn1(self.conv1(x)))
        x = F.relu(self.bn2(self.conv2(x)))
        return F.relu(self.bn3(self.conv3(x)) + shortcut)


BLOCKS: Mapping[str, type[BasicBlock] | type[Bottleneck]] = {
    "basic": BasicBlock,
    "bottleneck": Bottleneck,
}


class ResNet(nn.Module):
    """The backbone without its classifier.

    Attributes:
        channels: Of the feature maps that `forward` returns.
    """

    def __init__(self, block: str, depths: Sequence[int], width: int, *, inputs: int = 3) -> None:
        super().__init__()
        kind = BLOCKS[block]
        self.conv1 = nn.Conv2d(inputs, width, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        inputs, self.channels = width, [width * 2**n * kind.expansion for n in range(len(depths))]
        for n, depth in enumerate(depths):
            blocks = []
            for index in range(depth):
                stride = 2 if n > 0 and index == 0 else 1
                blocks.append(kind(inputs, width * 2**n, stride))
                inputs = self.channels[n]
            setattr(self, f"layer{n + 1}", nn.Sequential(*blocks))

    def forward(self, images: Tensor) -> list[Tensor]:
        """(B, 3, H, W) to feature maps at strides 4, 8, 16 …, one for each layer."""
        x, maps = self.stem(images), []
        for n in range(len(self.channels)):
            x = self.layer(n, x)
            maps.append(x)
        return maps

    def stem(self, images: Tensor) -> Tensor:
        """(B, 3, H, W) to (B, width, H/4, W/4)."""
        # the same as the other way round, and less to do
        return F.relu(F.max_pool2d(self.bn1(self.conv1(images)), 3, 2, 1))

    def layer(self, number: int, x: Tensor) -> Tensor:
        """One of its layers, 0 the first: for who puts something between them."""
        out: Tensor = self.get_submodule(f"layer{number + 1}")(x)
        return out
