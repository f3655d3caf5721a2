"""What `interfuser` learns: who stands in which cell, which signal governs, and where to go."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from agents.driveinsight.rows import SPEED
from agents.zoo.errors import waypoint_error
from agents.zoo.system import Labels, Output

# As published, told relative to the waypoints' 0.2
MAP, MOTION, LINE, LIGHT, STOP = 2.5, 0.25, 0.25, 0.5, 0.05
FIRST, LAST = 0.14, 0.045  # of the waypoints' weights
LINE_M = 25.0  # ahead, within which a stop line is to be told


def interfuser_losses(output: Output, labels: Labels, cells: int) -> dict[str, Tensor]:
    """The terms, weighted."""
    said = output.said or {}
    count = output.waypoints.shape[1]
    weights = torch.linspace(FIRST, LAST, count).tolist()
    rows, known = density_map(labels["objects"], cells)  # (B, cells², 8), (B, cells²)
    there, found = rows[..., 0], said["objects"].float()
    presence = F.binary_cross_entropy_with_logits(found[..., 0], there, reduction="none")
    error = (found[..., 1:] - rows[..., 1:]).abs()  # (B, cells², 7)
    traffic, asked = traffic_state(labels["signal"])
    wrong = F.binary_cross_entropy_with_logits(said["traffic"].float(), traffic, reduction="none")
    return {
        "waypoints": waypoint_error(output, labels, weights),
        # those that are there weigh as much as all that are empty
        "map": MAP * 0.5 * (_mean(presence, there) + _mean(presence, known * (1.0 - there))),
        "boxes": MAP * 0.1 * _mean(error[..., :6].sum(dim=2), there),
        "motion": MOTION * _mean(error[..., 6], there),
        "line": LINE * wrong[:, 0].mean(),
        "light": LIGHT * _mean(wrong[:, 1], asked),
        "stop": STOP * _mean(wrong[:, 2], asked),
    }


def density_map(objects: Tensor, cells: int) -> tuple[Tensor, Tensor]:
    """Who stands in which cell of 1 m: ahead of the ego, and to both sides.

    Args:
        objects: (B, N, 9) the label; the last column 1 for who is in sight, -1 for who is hidden.
        cells: Along each side.

    Returns:
        (B, cells², 8) presence, offset from the cell's middle (2), log length and width, sine and
        cosine of the heading, speed in tens of metres a second; and (B, cells²) 0 where somebody
        hidden stands, whom nobody can be asked for.
    """
    batch = len(objects)
    x, y, yaw = objects[..., 0], objects[..., 1], objects[..., 2]
    column, row = x.floor().long(), (y + 0.5 * cells).floor().long()
    inside = (column >= 0) & (column < cells) & (row >= 0) & (row < cells)
    cell = torch.where(inside, column * cells + row, cells**2)  # the last is thrown away
    speed = torch.hypot(objects[..., 5], objects[..., 6]) / SPEED
    size = objects[..., 3:5].clamp(min=0.1).log()
    middle = torch.stack([column + 0.5, row + 0.5 - 0.5 * cells], dim=2)
    values = torch.cat(
        [
            torch.ones_like(x)[..., None],
            objects[..., :2] - middle,
            size,
            torch.stack([yaw.sin(), yaw.cos(), speed], dim=2),
        ],
        dim=2,
    )
    seen, hidden = objects[..., 8] > 0.0, objects[..., 8] < 0.0
    rows = objects.new_zeros(batch, cells**2 + 1, values.shape[2])
    known = objects.new_ones(batch, cells**2 + 1)
    # from the farthest to the nearest, who is written last and stays
    for n in reversed(range(objects.shape[1])):
        sample = torch.arange(batch, device=objects.device)
        chosen = sample[seen[:, n]]
        rows[chosen, cell[chosen, n]] = values[chosen, n]
        chosen = sample[hidden[:, n]]
        known[chosen, cell[chosen, n]] = 0.0
    return rows[:, :-1], known[:, :-1]


def traffic_state(signal: Tensor) -> tuple[Tensor, Tensor]:
    """(B, 3) whether a line is near, shows red or yellow, is a sign's; (B,) whether it is near."""
    near = ((signal[:, 7] > 0.0) & (signal[:, 0] < LINE_M)).float()
    red = (signal[:, 3] + signal[:, 4]).clamp(max=1.0)
    return torch.stack([near, red, signal[:, 6]], dim=1), near


def _mean(values: Tensor, weights: Tensor) -> Tensor:
    return (values * weights).sum() / weights.sum().clamp(min=1.0)
