"""The sizes of `lbc` and of its teacher."""

from __future__ import annotations

from dataclasses import dataclass

from agents.networks.sizes import check_sizes
from agents.zoo.system import SystemConfig

_VIEWS = ("camera_front", "camera_left", "camera_right", "camera_front_narrow")


@dataclass(frozen=True, kw_only=True)
class LbcConfig(SystemConfig):
    """What it sees, and the sizes of its networks.

    Attributes:
        teacher: Channels of the teacher's U-Net over the view from above, the finest first.
        student: Of the student's over the images; none for the teacher alone.
        action_weight: Of the error of the action that is read off the points.
    """

    told: tuple[str, ...] = ("target_point",)
    teacher: tuple[int, ...] = (24, 32, 48, 64, 96)
    student: tuple[int, ...] = ()
    action_weight: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("teacher", "student"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        check_sizes(self, "teacher", "student")
        if bool(self.student) != bool(self.cameras):
            raise ValueError("a student has cameras, and a teacher has none")


CONFIGS = {
    "lbc-teacher": LbcConfig(
        system="lbc-teacher", raster=True, labels=("action",), told=("target_point",)
    ),
    "lbc": LbcConfig(system="lbc", cameras=_VIEWS, labels=("raster",), student=(32, 64, 128)),
}
