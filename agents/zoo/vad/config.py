"""The sizes of `vad`."""

from __future__ import annotations

from dataclasses import dataclass

from agents.networks.sizes import check_sizes
from agents.zoo.system import FAMILY, SystemConfig


@dataclass(frozen=True, kw_only=True)
class VadConfig(SystemConfig):
    """What it sees, and the sizes of its network.

    Attributes:
        width: Of a query.
        heads: Of attention.
        layers: In which queries look at the map.
        agents: Queries for others.
        lines: Queries for lines of the road.
        modes: Ways that each of the others may go on.
    """

    system: str = "vad"
    cameras: tuple[str, ...] = tuple(camera.name for camera in FAMILY.cameras)
    told: tuple[str, ...] = ("command", "speed")
    odometry: bool = True
    past: int = 2
    waypoints: int = 6
    labels: tuple[str, ...] = ("objects", "motion", "map")
    width: int = 80
    heads: int = 4
    layers: int = 2
    agents: int = 24
    lines: int = 32
    modes: int = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        check_sizes(self, "width", "heads", "layers")
        check_sizes(self, "agents", "lines", "modes")
        if self.width % self.heads:
            raise ValueError(f"{self.heads} heads do not share a width of {self.width} evenly")


CONFIGS = {"vad": VadConfig()}
