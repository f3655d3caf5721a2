"""Reads the heads: maps to the few rows that a planner takes, with gradients to what they say."""

from __future__ import annotations

import functools
import math

import torch
import torch.nn.functional as F
from torch import Tensor

from agents.driveinsight.heads import KIND_OF_CLASS, SPEED_MPS, Heads
from agents.driveinsight.seen import OBJECTS, SIGNALS, Seen
from agents.networks.grid import GridConfig

LEAST_SCORE = 0.1  # below which a peak is nobody
_APART = (5, 3, 3)  # cells, a side: of the peaks of a class in these the highest alone counts
_NEAR = 3  # cells a side round the likeliest place of the line that its place is the mean of


def read_seen(heads: Heads, grid: GridConfig) -> Seen:
    """The highest peaks of the heatmaps, and the stop line that governs.

    Which cells are read is a choice, without gradient; what they say has one, scores included.
    """
    return Seen(objects=_objects(heads, grid), signals=_signals(heads, grid))


def _objects(heads: Heads, grid: GridConfig) -> Tensor:
    """(B, OBJECTS, 9)."""
    scores = heads.heat.float().sigmoid().contiguous()  # (B, 3, X, Y)
    with torch.no_grad():
        highest = torch.stack(
            [_highest_near(scores[:, n], side) for n, side in enumerate(_APART)], dim=1
        )
        peaks = torch.where(scores == highest, scores, 0.0).flatten(1)
        chosen = peaks.topk(OBJECTS, dim=1).indices  # (B, K) of 3 * X * Y
    score = scores.flatten(1).gather(1, chosen)
    class_, cell = chosen // grid.cells**2, chosen % grid.cells**2
    boxes = heads.boxes.float().flatten(2)  # (B, BOX, X*Y)
    box = boxes.gather(2, cell[:, None].expand(-1, boxes.shape[1], -1))  # (B, BOX, K)
    along, across, length, width, sine, cosine, vx, vy = box.unbind(dim=1)  # (B, K) each
    kinds = torch.tensor(KIND_OF_CLASS, device=score.device, dtype=score.dtype)
    rows = torch.stack(
        [
            grid.x_min_m + (cell // grid.cells + 0.5 + along) * grid.cell_x_m,
            grid.y_min_m + (cell % grid.cells + 0.5 + across) * grid.cell_y_m,
            torch.atan2(sine, cosine),
            length.clamp(-3.0, 4.0).exp(),
            width.clamp(-3.0, 3.0).exp(),
            vx * SPEED_MPS,
            vy * SPEED_MPS,
            kinds[class_],
            score,
        ],
        dim=2,
    )
    return torch.where(score[..., None] >= LEAST_SCORE, rows, 0.0)


def _highest_near(scores: Tensor, side: int) -> Tensor:
    """(B, X, Y) the highest of (B, X, Y) in the square of so many cells a side round each cell.

    As max pooling, which also finds out where it is and takes eight times as long.
    """
    half, (x, y) = side // 2, scores.shape[1:]
    wide = F.pad(scores, (half,) * 4, value=-math.inf)
    rows = functools.reduce(torch.maximum, (wide[:, n : n + x] for n in range(side)))
    return functools.reduce(torch.maximum, (rows[:, :, n : n + y] for n in range(side)))


def _signals(heads: Heads, grid: GridConfig) -> Tensor:
    """(B, SIGNALS, 8): one row, and zeros."""
    batch, half = len(heads.where), grid.cells // 2
    share = heads.where.float().softmax(dim=1)
    presence = 1.0 - share[:, -1]
    maps = share[:, :-1].view(batch, 1, half, half)
    with torch.no_grad():
        best = maps.flatten(1).argmax(dim=1)  # (B,)
        row, column = best // half, best % half
        step = torch.arange(half, device=best.device)
        near_x = (step - row[:, None]).abs() <= _NEAR // 2  # (B, X/2)
        near_y = (step - column[:, None]).abs() <= _NEAR // 2
        near = (near_x[:, :, None] & near_y[:, None, :])[:, None]
    weights = torch.where(near, maps, 0.0)
    weights = weights / weights.sum(dim=(2, 3), keepdim=True).clamp(min=1e-9)
    line = heads.line.float()
    centre = torch.arange(half, device=line.device) + 0.5
    x = grid.x_min_m + (centre[None, :, None] + line[:, 0]) * 2.0 * grid.cell_x_m
    y = grid.y_min_m + (centre[None, None, :] + line[:, 1]) * 2.0 * grid.cell_y_m
    x, y, sine, cosine = (
        (weights[:, 0] * values).sum(dim=(1, 2)) for values in (x, y, line[:, 2], line[:, 3])
    )
    state = heads.state.float().softmax(dim=1)
    first = torch.cat(
        [torch.stack([x, y, torch.atan2(sine, cosine)], dim=1), state, presence[:, None]], dim=1
    )
    return torch.stack([first, *[torch.zeros_like(first)] * (SIGNALS - 1)], dim=1)
