"""The sizes of `thinktwice`."""

from __future__ import annotations

from dataclasses import dataclass

from agents.networks.sizes import check_sizes
from agents.zoo.system import FAMILY, SystemConfig


@dataclass(frozen=True, kw_only=True)
class ThinkTwiceConfig(SystemConfig):
    """What it sees, and the sizes of its network.

    Attributes:
        levels: Of its own maps, each half as large as the one before.
        token: Width of what encodes each component that it is told.
        width: Of what it plans from.
        rolled: Channels of the map that is rolled forward.
        layers: Times that it thinks again.
        looks: Places around each planned point that it looks at.
        teacher: Channels of the teacher's convolutions, which are those of `roach-raster`.
        teacher_width: Of what the teacher joins view and speed in.
    """

    system: str = "thinktwice"
    cameras: tuple[str, ...] = tuple(camera.name for camera in FAMILY.cameras)
    lidar: str = "paper"
    told: tuple[str, ...] = ("target_point", "command", "speed")
    odometry: bool = True
    past: int = 1
    labels: tuple[str, ...] = ("action", "raster", "future")
    levels: tuple[int, ...] = (32, 32, 40, 40)
    token: int = 32
    width: int = 64
    rolled: int = 32
    layers: int = 2
    looks: int = 4
    teacher: tuple[int, ...] = (16, 32, 48, 64, 96)
    teacher_width: int = 192

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("levels", "teacher"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        check_sizes(self, "levels", "token", "width", "rolled", "layers")
        check_sizes(self, "looks", "teacher", "teacher_width")
        if len(self.levels) != 4 or len(self.teacher) < 4:
            raise ValueError("it has four levels, and its teacher has as many or more")


CONFIGS = {"thinktwice": ThinkTwiceConfig()}
