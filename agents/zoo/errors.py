"""Terms of losses that several systems share."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from agents.zoo.system import Labels, Output


def waypoint_error(
    output: Output, labels: Labels, weights: Sequence[float] | None = None
) -> Tensor:
    """L1 of the waypoints, x and y added [m], over those that are known.

    Args:
        output: What a system said.
        labels: With `waypoints` (B, T, 2) and `valid` (B, T).
        weights: Of each waypoint; all alike without.
    """
    error = (output.waypoints.float() - labels["waypoints"]).abs().sum(dim=2)  # (B, T)
    share = labels["valid"]
    if weights is not None:
        share = share * torch.tensor(weights, device=share.device)
    return (error * share).sum() / share.sum().clamp(min=1e-3)


def action_error(output: Output, labels: Labels) -> Tensor:
    """L1 of throttle less brake, and of steer, added."""
    assert output.action is not None, "this system says no action"
    return (output.action.float() - labels["action"]).abs().sum(dim=1).mean()
