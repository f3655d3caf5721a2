"""The sizes of `interfuser`."""

from __future__ import annotations

from dataclasses import dataclass

from agents.networks.sizes import check_sizes
from agents.zoo.system import SystemConfig


@dataclass(frozen=True, kw_only=True)
class InterfuserConfig(SystemConfig):
    """What it sees, and the sizes of its network.

    Attributes:
        heights_m: Edges of the slices that LiDAR points are counted in, above the ground.
        image_width: Channels of the first of four layers over images.
        lidar_width: Of the first over LiDAR points.
        width: Of a token.
        heads: Of attention.
        encoder_layers: In which tokens of all views look at each other.
        decoder_layers: In which queries look at them.
        cells: Of the object density map, along each side, each of 1 m: ahead, and centred.
        gru: Width of the GRU that plans.
    """

    system: str = "interfuser"
    cameras: tuple[str, ...] = (
        "camera_front",
        "camera_left",
        "camera_right",
        "camera_front_narrow",
    )
    lidar: str = "paper"
    told: tuple[str, ...] = ("target_point", "speed")
    waypoints: int = 8
    labels: tuple[str, ...] = ("objects", "signal")
    heights_m: tuple[float, ...] = (-1.0, 0.2, 4.0)
    image_width: int = 16
    lidar_width: int = 12
    width: int = 80
    heads: int = 8
    encoder_layers: int = 2
    decoder_layers: int = 2
    cells: int = 20
    gru: int = 64

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "heights_m", tuple(self.heights_m))
        check_sizes(self, "image_width", "lidar_width", "width", "heads", "cells", "gru")
        check_sizes(self, "encoder_layers", "decoder_layers")
        if self.width % self.heads:
            raise ValueError(f"{self.heads} heads do not share a width of {self.width} evenly")


CONFIGS = {"interfuser": InterfuserConfig()}
