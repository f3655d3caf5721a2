"""The teacher itself: the true view from above and the speed to an action, and to waypoints."""

from __future__ import annotations

from torch import Tensor

from agents.driveinsight.rows import SPEED
from agents.explain.protocol import Anatomy, FeatureMap, TokenGroup
from agents.networks.raster_teacher import RasterTeacher
from agents.zoo.errors import action_error, waypoint_error
from agents.zoo.raster import GRID, RasterChannel
from agents.zoo.roach_raster.config import RoachConfig
from agents.zoo.system import Labels, Output, Seen, State, SystemModel

_SHOWN = 2  # the convolution whose map is shown: 12 x 12 cells of 4 m


class RoachRaster(SystemModel):
    """The network; who learns from it takes its part `teacher`."""

    def __init__(self, config: RoachConfig) -> None:
        super().__init__()
        self.config: RoachConfig = config
        self.teacher = RasterTeacher(
            len(RasterChannel), GRID.cells, config.widths, config.width, config.waypoints
        )

    def forward(self, seen: Seen, state: State | None = None) -> Output:
        said = self.teacher(seen["raster"], seen["speed"] / SPEED)
        return Output(waypoints=said.waypoints, action=said.action)

    def loss(self, output: Output, labels: Labels) -> dict[str, Tensor]:
        return {
            "waypoints": waypoint_error(output, labels),
            "action": self.config.action_weight * action_error(output, labels),
        }

    @property
    def anatomy(self) -> Anatomy:
        extent_m = (GRID.x_min_m, GRID.x_max_m, GRID.y_min_m, GRID.y_max_m)
        return Anatomy(
            groups={"speed": TokenGroup(tap="teacher.speed")},
            maps={"raster": FeatureMap(tap=f"teacher.taps.{_SHOWN}", extent_m=extent_m)},
        )
