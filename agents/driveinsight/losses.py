"""What training brings down: L1 of the waypoints, and what keeps BEV features about the scene.

Source: the paper, sections 3.2 and 4.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from agents.driveinsight.model import Output
from agents.driveinsight.semantics import CLASS_WEIGHTS


@dataclass(frozen=True, kw_only=True)
class LossConfig:
    """Weights of the terms.

    Attributes:
        nearness: The k-th waypoint weighs as `k ** -nearness`; 0 weighs all alike, as the paper
            does. Errors grow with time: without it the last waypoint, 4 s ahead, decides what is
            learned, and the first one, which the car is driven by, is off by 0.2 m where it stands.
        semantics: Of BEV features.
    """

    nearness: float = 1.0
    semantics: float = 0.5


@dataclass(frozen=True, kw_only=True)
class Targets:
    """What the expert did and what was there.

    Attributes:
        waypoints: (B, T, 2) [m].
        valid: (B, T) 0 or 1: where the drive went on that long.
        semantics: (B, X, Y) `BevClass`; None where there is none.
        stands_for: (B, 3) 0 or 1: what the expert stands for, see `agents.training.standing`; None
            where it is not known.
    """

    waypoints: Tensor
    valid: Tensor
    semantics: Tensor | None = None
    stands_for: Tensor | None = None


def losses(output: Output, targets: Targets, config: LossConfig) -> dict[str, Tensor]:
    """The terms by name, weighted, and their sum as `total`."""
    error = (output.waypoints.float() - targets.waypoints).abs().sum(dim=2)  # (B, T)
    weights = _waypoint_weights(targets, config)
    terms = {"waypoints": (error * weights).sum() / weights.sum().clamp(min=1e-3)}
    if output.heads is not None and targets.semantics is not None:
        classes = torch.tensor(CLASS_WEIGHTS, device=output.waypoints.device)
        entropy = F.cross_entropy(output.heads.semantics.float(), targets.semantics.long(), classes)
        terms["semantics"] = config.semantics * entropy
    return {**terms, "total": torch.stack(list(terms.values())).sum()}


def counts(targets: Targets, config: LossConfig) -> dict[str, Tensor]:
    """By the names of `losses`, what each term is the mean over: parts of a batch weigh by it."""
    found = {"waypoints": _waypoint_weights(targets, config).sum()}
    if targets.semantics is not None:
        weights = torch.tensor(CLASS_WEIGHTS, device=targets.semantics.device)
        found["semantics"] = weights[targets.semantics.long()].sum()
    return found


def _waypoint_weights(targets: Targets, config: LossConfig) -> Tensor:
    """(B, T), 0 where the drive had ended."""
    times = torch.arange(1, targets.valid.shape[1] + 1, device=targets.valid.device)
    return targets.valid * times.float() ** -config.nearness
