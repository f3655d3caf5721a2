"""Temporal fusion: past BEV features, brought to where the ego is now, beside the present ones.

The memory bank is a value: `remember` makes a new one, and nothing is kept in the module. What is
remembered of a moment is made from that moment alone: so each is encoded once, in training with
gradients to all the moments that remember it.
Source: the paper, section 3.2, "Temporal Fusion".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.networks.grid import GridConfig
from agents.networks.taps import Tap
from agents.networks.unet import UNet


@dataclass(frozen=True, kw_only=True)
class MemoryBank:
    """The last K frames, newest first.

    Attributes:
        features: (B, K, C, X, Y) fused BEV features; zeros where there was no frame.
        poses: (B, K, 3) x, y [m], yaw [rad] of the ego then, in a frame that stays.
        valid: (B, K) whether there was a frame.
    """

    features: Tensor
    poses: Tensor
    valid: Tensor

    def remember(self, features: Tensor, pose: Tensor) -> MemoryBank:
        """The bank with one more frame, (B, C, X, Y) at (B, 3), and without its oldest."""
        return MemoryBank(
            features=torch.cat([features[:, None], self.features[:, :-1]], dim=1),
            poses=torch.cat([pose[:, None], self.poses[:, :-1]], dim=1),
            valid=torch.cat([torch.ones_like(self.valid[:, :1]), self.valid[:, :-1]], dim=1),
        )


def empty_bank(batch: int, frames: int, channels: int, cells: int, *, like: Tensor) -> MemoryBank:
    """A bank that remembers nothing, of the device and type of `like`."""
    return MemoryBank(
        features=like.new_zeros(batch, frames, channels, cells, cells),
        poses=torch.zeros(batch, frames, 3, device=like.device),
        valid=torch.zeros(batch, frames, dtype=torch.bool, device=like.device),
    )


def warp(features: Tensor, then: Tensor, now: Tensor, grid: GridConfig) -> Tensor:
    """Brings features of one place to another: the world stays where it is, the grid moves.

    Args:
        features: (B, C, X, Y) seen at `then`.
        then: (B, 3) x, y [m], yaw [rad] of the ego when they were seen, in a frame that stays.
        now: (B, 3) where they are wanted.
        grid: Both grids.

    Returns:
        (B, C, X, Y), bilinear between cells, zero where nothing was seen.
    """
    ahead, right = _cell_centres(grid, features)
    cos, sin = now[:, 2].cos(), now[:, 2].sin()
    x = now[:, 0, None] + cos[:, None] * ahead - sin[:, None] * right - then[:, 0, None]
    y = now[:, 1, None] + sin[:, None] * ahead + cos[:, None] * right - then[:, 1, None]
    cos, sin = then[:, 2, None].cos(), then[:, 2, None].sin()
    ahead, right = cos * x + sin * y, cos * y - sin * x  # (B, X*Y), in the ego's frame of then
    # grid_sample's first axis is the last of the map, y; -1 and 1 are the grid's edges
    along_x = 2.0 * (ahead - grid.x_min_m) / (grid.x_max_m - grid.x_min_m) - 1.0
    along_y = 2.0 * (right - grid.y_min_m) / (grid.y_max_m - grid.y_min_m) - 1.0
    where = torch.stack([along_y, along_x], dim=2).view(-1, grid.cells, grid.cells, 2)
    # places are whole in mixed precision too: bfloat16 would move them by up to 7 cm
    return F.grid_sample(features.float(), where, align_corners=False).to(features.dtype)


def _cell_centres(grid: GridConfig, like: Tensor) -> tuple[Tensor, Tensor]:
    """(X*Y,) x and (X*Y,) y of the cells' centres, in the order of a flattened map."""
    step = torch.arange(grid.cells, device=like.device, dtype=torch.float32) + 0.5
    x = grid.x_min_m + step * grid.cell_x_m
    y = grid.y_min_m + step * grid.cell_y_m
    return x.repeat_interleave(grid.cells), y.repeat(grid.cells)


def bank_of_sequence(frames: Tensor, poses: Tensor, reach: int) -> MemoryBank:
    """What is remembered at each moment of some sequences: the moments before it.

    Args:
        frames: (B, T, C, X, Y) of each moment.
        poses: (B, T, 3) of the ego then.
        reach: How many moments are remembered, K.

    Returns:
        Of B * T moments, those of a sequence one after the other.
    """
    batch, moments = frames.shape[:2]
    features, places = [], []
    steps = range(1, reach + 1)
    for k in steps:
        before = min(k, moments)
        none = frames.new_zeros(batch, before, *frames.shape[2:])
        features.append(torch.cat([none, frames[:, : moments - before]], dim=1))
        nowhere = poses.new_zeros(batch, before, 3)
        places.append(torch.cat([nowhere, poses[:, : moments - before]], dim=1))
    there = torch.tensor([[t >= k for k in steps] for t in range(moments)], device=frames.device)
    return MemoryBank(
        features=torch.stack(features, dim=2).flatten(0, 1),
        poses=torch.stack(places, dim=2).flatten(0, 1),
        valid=there.repeat(batch, 1),
    )


class TemporalFusion(nn.Module):
    """What is seen now and what is remembered, to one map that has looked far around.

    Args:
        width: Channels of the features of one moment.
        remembered: Channels of what is remembered of it.
        frames: Moments that are remembered.
        widths: Of the U-Net.
        grid: Of all maps.
    """

    def __init__(
        self, width: int, remembered: int, frames: int, widths: Sequence[int], grid: GridConfig
    ) -> None:
        super().__init__()
        self.grid, self.frames = grid, frames
        self.keep = nn.Conv2d(width, remembered, 1) if frames else None
        self.frame = Tap()
        self.mix = UNet(width + frames * remembered, widths)
        self.bev = Tap()

    def remembered(self, features: Tensor) -> Tensor:
        """(B, C, X, Y) features of a moment to what is remembered of it."""
        assert self.keep is not None, "this policy has no memory"
        return self.frame(self.keep(features))

    def forward(self, features: Tensor, pose: Tensor | None, bank: MemoryBank | None) -> Tensor:
        """Fuses.

        Args:
            features: (B, C, X, Y) seen now.
            pose: (B, 3) of the ego now; None without a memory.
            bank: What is remembered; None without a memory.

        Returns:
            (B, widths[0], X, Y).
        """
        past = []
        for k in range(self.frames):
            assert pose is not None, "this policy has a memory: give pose"
            assert bank is not None, "this policy has a memory: give a bank"
            brought = warp(bank.features[:, k], bank.poses[:, k], pose, self.grid)
            brought = brought.contiguous(memory_format=torch.channels_last)
            past.append(brought * bank.valid[:, k, None, None, None])
        return self.bev(self.mix(torch.cat([features, *past], dim=1)))
