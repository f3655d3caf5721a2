"""Three commands of the six that a prompt has: as the systems know them that plan for each."""

from __future__ import annotations

import torch
from torch import Tensor

from agents.driveinsight.rows import one_hot

COMMANDS = 3  # left, right, neither
# By `RoadOption` from LEFT on: changes of lane count as turns
_COMMAND_OF = (0, 1, 2, 2, 0, 1)


def command_of(option: Tensor) -> Tensor:
    """(B, COMMANDS) 0 or 1 of (B,) `RoadOption`; who is told none goes neither left nor right."""
    table = torch.tensor(_COMMAND_OF, device=option.device)
    option = option.long()
    known = (option >= 1) & (option <= len(_COMMAND_OF))
    chosen = torch.where(known, table[(option - 1).clamp(0, len(_COMMAND_OF) - 1)], 2)
    return one_hot(chosen, COMMANDS)
