"""The sizes of `roach-raster`."""

from __future__ import annotations

from dataclasses import dataclass

from agents.networks.sizes import check_sizes
from agents.zoo.system import SystemConfig


@dataclass(frozen=True, kw_only=True)
class RoachConfig(SystemConfig):
    """What it is given, and the sizes of its network.

    Attributes:
        widths: Channels of the convolutions over the view from above.
        width: Of what view and speed are joined in.
        action_weight: Of the error of the action beside that of the waypoints.
    """

    system: str = "roach-raster"
    told: tuple[str, ...] = ("speed",)
    raster: bool = True
    labels: tuple[str, ...] = ("action",)
    widths: tuple[int, ...] = (16, 32, 48, 64, 96)
    width: int = 192
    action_weight: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "widths", tuple(self.widths))
        check_sizes(self, "widths", "width")


CONFIGS = {"roach-raster": RoachConfig()}
