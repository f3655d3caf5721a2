"""What perception reads off its maps, as a few rows: who is there, and which signal governs.

The planner takes these rows beside the told ones of the prompt. They have the very columns of the
prompt's obstacles, so that both kinds of row go through one encoder; where the prompt says whether
a row is there, perception says how sure it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from typing_extensions import Self

OBJECTS = 24
OBJECT_COLUMNS = 9
SIGNALS = 2
SIGNAL_COLUMNS = 8


@dataclass(frozen=True, kw_only=True)
class Seen:
    """What is seen at one moment, B samples at once; all in the ego frame: x ahead, y right.

    Attributes:
        objects: (B, OBJECTS, 9) x, y [m], yaw [rad], length, width [m], vx, vy over the ground
            [m/s], `ActorKind`, score 0..1; by falling score, zeros where there is no more.
        signals: (B, SIGNALS, 8) x, y [m], yaw [rad] of the stop line, probabilities of red, yellow,
            green and of a stop sign, presence 0..1; by falling presence, zeros where there is no
            more.
    """

    objects: Tensor
    signals: Tensor

    @classmethod
    def nothing(cls, batch: int, *, device: torch.device | str = "cpu") -> Self:
        """Rows that show nothing."""
        return cls(
            objects=torch.zeros(batch, OBJECTS, OBJECT_COLUMNS, device=device),
            signals=torch.zeros(batch, SIGNALS, SIGNAL_COLUMNS, device=device),
        )
