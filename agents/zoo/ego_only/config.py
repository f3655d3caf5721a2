"""The sizes of `ego-only`."""

from __future__ import annotations

from dataclasses import dataclass

from agents.networks.sizes import check_sizes
from agents.zoo.system import SystemConfig


@dataclass(frozen=True, kw_only=True)
class EgoOnlyConfig(SystemConfig):
    """What it is told, and how wide its layers are.

    Attributes:
        token: Width of what encodes each component.
        width: Of the layers over all of them.
    """

    system: str = "ego-only"
    told: tuple[str, ...] = ("target_point", "command", "speed")
    token: int = 32
    width: int = 256

    def __post_init__(self) -> None:
        super().__post_init__()
        check_sizes(self, "token", "width")


CONFIGS = {"ego-only": EgoOnlyConfig()}
