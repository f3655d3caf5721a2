"""3-D sparse convolutions in plain torch: only voxels that hold something are worked on.

Which voxel takes from which, the kernel map, is found through a dense table of indices, as our
grids are small, and is shared by the convolutions of a level. To halve the grid, eight voxels make
one: a kernel of 2 spreads nothing, while one of 3 would multiply the voxels.
Source: Graham et al., 3D Semantic Segmentation with Submanifold Sparse Convolutional Networks,
CVPR 2018; Yan et al., SECOND, Sensors 2018.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product

import torch
import torch.nn.functional as F
from torch import Tensor, nn

_AROUND = tuple(product((-1, 0, 1), repeat=3))  # offsets of a submanifold convolution
_BELOW = tuple(product((0, 1), repeat=3))  # offsets of one that halves the grid


@dataclass(frozen=True, kw_only=True)
class SparseVoxels:
    """Voxels that hold something.

    Attributes:
        features: (V, C).
        index: (V, 4) batch, z, x, y; each place once.
        shape: Size of the grid, Z, X, Y.
        batch: Number of samples.
    """

    features: Tensor
    index: Tensor
    shape: tuple[int, int, int]
    batch: int

    def key(self) -> Tensor:
        """(V,) one number for each voxel's place."""
        return _key(self.index, self.shape)

    def dense(self) -> Tensor:
        """(B, C, Z, X, Y), zero where there is no voxel."""
        channels = self.features.shape[1]
        out = self.features.new_zeros(self.batch * math.prod(self.shape), channels)
        out = out.index_copy(0, self.key(), self.features)
        return out.view(self.batch, *self.shape, channels).permute(0, 4, 1, 2, 3)


def _key(index: Tensor, shape: tuple[int, int, int]) -> Tensor:
    b, z, x, y = index.unbind(1)
    return ((b * shape[0] + z) * shape[1] + x) * shape[2] + y


def _index(key: Tensor, shape: tuple[int, int, int]) -> Tensor:
    depth, width, height = shape
    return torch.stack(
        [
            key // (depth * width * height),
            key // (width * height) % depth,
            key // height % width,
            key % height,
        ],
        dim=1,
    )


def neighbours(voxels: SparseVoxels) -> Tensor:
    """The kernel map of a submanifold convolution: (V, 27) rows, V where there is no voxel."""
    return _rows(voxels, voxels.index, 1, _AROUND)


def halves(voxels: SparseVoxels, places: Tensor) -> Tensor:
    """The kernel map of a halving: (W, 8) rows of the input, V where there is no voxel.

    Args:
        voxels: The V voxels of the input.
        places: (W, 4) of the output, on the halved grid.
    """
    return _rows(voxels, places, 2, _BELOW)


def _rows(
    voxels: SparseVoxels, places: Tensor, stride: int, offsets: tuple[tuple[int, ...], ...]
) -> Tensor:
    shape, device, count = voxels.shape, places.device, len(voxels.index)
    table = torch.full((voxels.batch * math.prod(shape),), count, device=device)
    table[voxels.key()] = torch.arange(count, device=device)
    wanted = places[:, None, 1:] * stride + torch.tensor(offsets, device=device)  # (W, K, 3)
    inside = ((wanted >= 0) & (wanted < torch.tensor(shape, device=device))).all(dim=2)
    z, x, y = torch.where(inside[..., None], wanted, 0).unbind(2)
    key = ((places[:, :1] * shape[0] + z) * shape[1] + x) * shape[2] + y
    return torch.where(inside, table[key], count)


class SparseConv(nn.Module):
    """A convolution at places that are found beforehand, without bias."""

    def __init__(self, inputs: int, outputs: int, taps: int) -> None:
        super().__init__()
        scale = math.sqrt(2.0 / (inputs * taps))
        self.weight = nn.Parameter(torch.randn(taps, inputs, outputs) * scale)

    def forward(self, features: Tensor, rows: Tensor) -> Tensor:
        """(V, inputs) features and (W, taps) rows of them, V for none, to (W, outputs)."""
        padded = torch.cat([features, features.new_zeros(1, features.shape[1])])
        kernel = self.weight.flatten(0, 1)  # (taps*inputs, outputs)
        return padded.index_select(0, rows.flatten()).view(-1, len(kernel)) @ kernel


class SubmanifoldBlock(nn.Module):
    """A submanifold convolution: its voxels stay where they are."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.conv, self.norm = SparseConv(inputs, outputs, len(_AROUND)), nn.BatchNorm1d(outputs)

    def forward(self, voxels: SparseVoxels) -> SparseVoxels:
        features = self.conv(voxels.features, neighbours(voxels))
        return replace(voxels, features=F.relu(_normed(self.norm, features)))


class HalvingBlock(nn.Module):
    """A convolution that makes one voxel of eight; a grid of odd size is rounded up."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.conv, self.norm = SparseConv(inputs, outputs, len(_BELOW)), nn.BatchNorm1d(outputs)

    def forward(self, voxels: SparseVoxels) -> SparseVoxels:
        z, x, y = ((side + 1) // 2 for side in voxels.shape)
        half = torch.cat([voxels.index[:, :1], voxels.index[:, 1:] // 2], dim=1)
        places = _index(_key(half, (z, x, y)).unique(), (z, x, y))
        features = F.relu(_normed(self.norm, self.conv(voxels.features, halves(voxels, places))))
        return SparseVoxels(features=features, index=places, shape=(z, x, y), batch=voxels.batch)


def _normed(norm: nn.BatchNorm1d, features: Tensor) -> Tensor:
    """Normalised features; too few to have a deviation are left alone in training."""
    return norm(features) if len(features) > 1 or not norm.training else features
