"""The sizes of `driveadapter`."""

from __future__ import annotations

from dataclasses import dataclass

from agents.networks.sizes import check_sizes
from agents.zoo.system import FAMILY, SystemConfig


@dataclass(frozen=True, kw_only=True)
class DriveAdapterConfig(SystemConfig):
    """What it sees, and the sizes of its network.

    Attributes:
        masks: Of the U-Net that says masks, the finest first.
        raw: Of the ground at each size at which adapters read it.
        width: Of what waypoints are planned from.
        teacher: Channels of the teacher's convolutions, which are those of `roach-raster`.
        teacher_width: Of what the teacher joins view and speed in.
    """

    system: str = "driveadapter"
    cameras: tuple[str, ...] = tuple(camera.name for camera in FAMILY.cameras)
    lidar: str = "paper"
    told: tuple[str, ...] = ("routing", "speed")
    odometry: bool = True
    past: int = 1
    labels: tuple[str, ...] = ("action", "raster")
    masks: tuple[int, ...] = (20, 28, 40)
    raw: int = 20
    width: int = 64
    teacher: tuple[int, ...] = (16, 32, 48, 64, 96)
    teacher_width: int = 192

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("masks", "teacher"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        check_sizes(self, "masks", "raw", "width")
        check_sizes(self, "teacher", "teacher_width")


CONFIGS = {"driveadapter": DriveAdapterConfig()}
