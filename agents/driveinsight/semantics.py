"""What lies in each BEV cell, from the simulator: the teacher of the BEV features.

Source: the paper, section 3.2, supervises the BEV feature map besides the waypoints, after Jia et
al., DriveAdapter, ICCV 2023; our teacher is the truth itself.
"""

from __future__ import annotations

from enum import IntEnum

import torch
from torch import Tensor


class BevClass(IntEnum):
    """What a BEV cell holds; of several the one that is last here."""

    OTHER = 0
    ROAD = 1
    LINE = 2
    STOP = 3  # a stop line of a light, whatever it shows, or of a stop sign
    VEHICLE = 4
    WALKER = 5


# What a cell of each class weighs in training: the rare weigh more, as most cells hold nothing
CLASS_WEIGHTS = (0.5, 0.5, 1.0, 2.0, 1.5, 4.0)


def likeliest(logits: Tensor) -> Tensor:
    """(B, classes, X, Y) of who was trained by `CLASS_WEIGHTS` to (B, X, Y) `BevClass`.

    Weighted, a class that is twice as heavy seems twice as likely as it is: that is taken back.
    """
    weights = torch.tensor(CLASS_WEIGHTS, device=logits.device)
    return (logits.float() - weights.log()[:, None, None]).argmax(dim=1)
