"""The sizes of `st-p3`."""

from __future__ import annotations

from dataclasses import dataclass

from agents.networks.sizes import check_sizes
from agents.zoo.system import FAMILY, SystemConfig


@dataclass(frozen=True, kw_only=True)
class StP3Config(SystemConfig):
    """What it sees, and the sizes of its network.

    Attributes:
        future: Of the map that is rolled forward, at half as many cells.
        latent: Of the noise that tells futures apart.
        gru: Width of the GRU that refines.
    """

    system: str = "st-p3"
    cameras: tuple[str, ...] = tuple(camera.name for camera in FAMILY.cameras)
    told: tuple[str, ...] = ("target_point", "command", "speed")
    odometry: bool = True
    past: int = 2
    labels: tuple[str, ...] = ("semantics", "future")
    future: int = 48
    latent: int = 16
    gru: int = 64

    def __post_init__(self) -> None:
        super().__post_init__()
        check_sizes(self, "future", "latent", "gru")


CONFIGS = {"st-p3": StP3Config()}
