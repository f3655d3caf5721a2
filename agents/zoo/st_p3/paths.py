"""Paths that a car could take from its speed on, and what each costs on predicted maps."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from agents.networks.looking import features_at
from agents.zoo.eyes import BEV
from agents.zoo.system import MOMENT_DT_S

ACCELERATIONS_MPS2 = (-8.0, -5.0, -3.0, -1.5, -0.5, 0.0, 0.5, 1.5, 3.0)
CURVATURES = 15
# Least and greatest curvature [1/m], to the right, by command: left, right, neither
REACH = ((-0.2, 0.02), (-0.02, 0.2), (-0.06, 0.06))
# Hand-made costs, as published
SAFETY, HEADWAY, DIVIDER, RULE, COMFORT, PROGRESS = 1.0, 1.0, 10.0, 5.0, 1.0, 1.0
AHEAD_M = (5.0, 10.0)  # of the car, where nobody is to stand
COMFORT_MPS2 = 3.0
_BODY = 3  # cells that a car is wide
PROGRESS_M = 10.0  # that outweigh somebody in the way


def sampled_paths(speed_mps: Tensor, command: Tensor, count: int) -> Tensor:
    """Arcs of constant curvature and acceleration.

    Args:
        speed_mps: (B, 1).
        command: (B, 3) shares of left, right, neither.
        count: Of points, `MOMENT_DT_S` apart.

    Returns:
        (B, K, count, 2) x ahead, y right [m].
    """
    acceleration = speed_mps.new_tensor(ACCELERATIONS_MPS2)[None, :, None]  # (1, A, 1)
    time = MOMENT_DT_S * torch.arange(1, count + 1, device=speed_mps.device)
    speed = speed_mps[:, :, None].clamp(min=0.0)
    # who brakes stands in the end
    moving = torch.where(acceleration < 0.0, speed / (-acceleration).clamp(min=1e-3), 1e3)
    time = torch.minimum(time, moving)  # (B, A, T)
    station = (speed * time + 0.5 * acceleration * time.square())[:, :, None]  # (B, A, 1, T)
    # no product of matrices, which mixed precision would round: (B, 2)
    reach = (command[:, :, None] * speed_mps.new_tensor(REACH)).sum(dim=1)
    share = torch.linspace(0.0, 1.0, CURVATURES, device=speed_mps.device)
    curvature = torch.lerp(reach[:, :1], reach[:, 1:], share)[:, None, :, None]  # (B, 1, J, 1)
    half = 0.5 * curvature * station  # half of what it has turned
    chord = station * torch.sinc(half / torch.pi)
    return torch.stack([chord * half.cos(), chord * half.sin()], dim=4).flatten(1, 2)


def path_costs(paths: Tensor, speed_mps: Tensor, maps: Tensor) -> tuple[Tensor, Tensor]:
    """What paths cost.

    Args:
        paths: (B, K, T, 2) [m].
        speed_mps: (B, 1) at their beginning.
        maps: (B, T, 4, X, Y) on `BEV`: the learnt cost, and probabilities of somebody, a line and
            road, at each of their points' times.

    Returns:
        (B, K) learnt, and (B, K) hand-made costs.
    """
    batch, count, steps = paths.shape[:3]
    before = torch.cat([torch.zeros_like(paths[:, :, :1]), paths[:, :, :-1]], dim=2)
    step = paths - before  # (B, K, T, 2)
    length = step.square().sum(dim=3).clamp(min=1e-8).sqrt()
    ahead = step / length[..., None].clamp(min=0.05)
    somebody = F.max_pool2d(maps[:, :, 1], _BODY, 1, _BODY // 2)[:, :, None]
    wide = torch.cat([maps, somebody], dim=2).flatten(0, 1)  # (B*T, 5, X, Y)

    def at(places: Tensor) -> Tensor:
        flat = places.transpose(1, 2).flatten(0, 1)  # (B*T, K, 2)
        return features_at(wide, flat, BEV).unflatten(0, (batch, steps)).transpose(1, 2)

    here = at(paths)  # (B, K, T, 5)
    front = torch.stack([at(paths + far * ahead)[..., 1] for far in AHEAD_M]).amax(dim=0)
    speed = torch.cat([speed_mps[:, None].expand(-1, count, 1), length / MOMENT_DT_S], dim=2)
    along = speed.diff(dim=2) / MOMENT_DT_S  # (B, K, T)
    across = (length[..., 1:] / MOMENT_DT_S) * _turned(ahead) / MOMENT_DT_S
    discomfort = F.relu(along.abs() - COMFORT_MPS2).sum(dim=2)
    discomfort = discomfort + F.relu(across - COMFORT_MPS2).sum(dim=2)
    made = (
        SAFETY * (here[..., 4] * (1.0 + speed[..., 1:])).sum(dim=2)
        + HEADWAY * front.sum(dim=2)
        + DIVIDER / steps * here[..., 2].sum(dim=2)
        + RULE * (1.0 - here[..., 3]).sum(dim=2)
        + COMFORT * discomfort / steps
        - PROGRESS * length.sum(dim=2) / PROGRESS_M
    )
    return here[..., 0].sum(dim=2), made


def _turned(ahead: Tensor) -> Tensor:
    """(B, K, T - 1) sine of the angle between two steps."""
    first, second = ahead[:, :, :-1], ahead[:, :, 1:]
    return (first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]).abs()
