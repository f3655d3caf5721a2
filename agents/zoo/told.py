"""What a system is told of its way and itself, as tokens: by the encoders of the paper's policy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import torch
from torch import Tensor, nn

from agents.driveinsight.tokens import (
    CommandEncoder,
    RoutingEncoder,
    SpeedEncoder,
    TargetPointEncoder,
)
from agents.explain.protocol import TokenGroup
from agents.networks.taps import Tap
from agents.zoo.system import Seen
from di_envs.config import check_name
from di_envs.prompt import SPEED_HISTORY

_ENCODERS: Mapping[str, Callable[[int], nn.Module]] = {
    "command": CommandEncoder,
    "target_point": TargetPointEncoder,
    "routing": RoutingEncoder,
    "speed": lambda width: SpeedEncoder(width, 1),
    "speed_history": lambda width: SpeedEncoder(width, SPEED_HISTORY),
}


class ToldEncoder(nn.Module):
    """Components of the prompt to tokens, one for each."""

    def __init__(self, names: Sequence[str], width: int) -> None:
        super().__init__()
        for name in names:
            check_name(name, _ENCODERS, "component that a system is told")
        self.encoders = nn.ModuleDict({name: _ENCODERS[name](width) for name in names})
        self.taps = nn.ModuleDict({name: Tap() for name in names})

    def forward(self, seen: Seen) -> Tensor:
        """(B, N, width) in the order of the names."""
        tokens = [self.taps[name](encode(seen[name])) for name, encode in self.encoders.items()]
        return torch.cat(tokens, dim=1)

    def groups(self, path: str) -> dict[str, TokenGroup]:
        """Its components, for an anatomy; the module's dotted path is `path`."""
        return {name: TokenGroup(tap=f"{path}.taps.{name}") for name in self.encoders}
