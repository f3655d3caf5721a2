"""The sizes of `transfuser`."""

from __future__ import annotations

from dataclasses import dataclass

from agents.networks.sizes import check_sizes
from agents.zoo.system import SystemConfig


@dataclass(frozen=True, kw_only=True)
class TransfuserConfig(SystemConfig):
    """What it sees, and the sizes of its network.

    Attributes:
        heights_m: Edges of the slices that LiDAR points are counted in, above the ground.
        width: Channels of the first of four layers of both branches; each next has twice as many.
        heads: Of attention.
        layers: Of attention at each scale.
        image_anchors: Rows and columns that each camera's features are pooled to.
        lidar_anchors: Of the LiDAR's, along x and along y.
        gru: Width of the GRU that plans.
    """

    system: str = "transfuser"
    cameras: tuple[str, ...] = ("camera_front", "camera_front_narrow")
    lidar: str = "paper"
    told: tuple[str, ...] = ("target_point", "speed")
    heights_m: tuple[float, ...] = (-1.0, 0.2, 4.0)
    width: int = 12
    heads: int = 4
    layers: int = 2
    image_anchors: tuple[int, int] = (4, 8)
    lidar_anchors: tuple[int, int] = (8, 8)
    gru: int = 64

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("heights_m", "image_anchors", "lidar_anchors"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        check_sizes(self, "width", "heads", "layers", "image_anchors", "lidar_anchors", "gru")
        if self.width % self.heads:
            raise ValueError(f"{self.heads} heads do not share a width of {self.width} evenly")


CONFIGS = {"transfuser": TransfuserConfig()}
