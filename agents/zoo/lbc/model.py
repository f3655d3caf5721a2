"""A teacher that sees the truth says points for any target; a student finds them in its pictures.

Source: Chen et al., Learning by Cheating, CoRL 2019, in its authors' version for the CARLA
Challenge of 2020: both are networks from a map to heatmaps, into which the target is drawn. What we
changed: sizes; the narrow camera ahead stands among the student's channels.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.driveinsight.rows import METRES
from agents.explain.protocol import Anatomy, FeatureMap, TokenGroup
from agents.networks.blocks import conv_block
from agents.networks.images import normalised
from agents.networks.mlp import mlp
from agents.networks.taps import Tap
from agents.networks.unet import UNet
from agents.zoo.errors import action_error, waypoint_error
from agents.zoo.lbc.config import LbcConfig
from agents.zoo.lbc.points import (
    SpatialSoftmax,
    heat_of,
    metres_of_grid,
    metres_of_image,
    share_of_grid,
    share_of_image,
)
from agents.zoo.raster import GRID, RasterChannel
from agents.zoo.system import FAMILY, Labels, Output, Seen, State, SystemModel, TaughtModel

STRIDE = 4  # pixels to a cell of the student's heatmaps
MAP_RADIUS, IMAGE_RADIUS = 3.0, 2.0  # of the target that is drawn, in cells
_FRONT = next(camera for camera in FAMILY.cameras if camera.name == "camera_front")


class Teacher(nn.Module):
    """The true view from above and a target to points [m], and an action that is read off these."""

    def __init__(self, config: LbcConfig) -> None:
        super().__init__()
        self.body = UNet(len(RasterChannel) + 1, config.teacher)
        self.features = Tap()
        self.heat = nn.Conv2d(config.teacher[0], config.waypoints, 1)
        self.softmax = SpatialSoftmax()
        self.act = nn.Sequential(mlp(2 * config.waypoints, 64), nn.ReLU(), nn.Linear(64, 2))

    def forward(self, raster: Tensor, target: Tensor) -> Tensor:
        """(B, C, X, Y) and (B, 2) [m] to (B, T, 2) [m]."""
        drawn = heat_of(share_of_grid(target, GRID), GRID.cells, GRID.cells, MAP_RADIUS)
        features = self.features(self.body(torch.cat([raster, drawn], dim=1)))
        return metres_of_grid(self.softmax(self.heat(features)), GRID)

    def action(self, points: Tensor) -> Tensor:
        """(B, 2) throttle less brake, and steer, for (B, T, 2) points."""
        found: Tensor = self.act(points.flatten(1) / METRES).tanh()
        return found


class Student(nn.Module):
    """Pictures side by side in channels, and a target in the front one, to points in that one."""

    def __init__(self, config: LbcConfig) -> None:
        super().__init__()
        first = config.student[0]
        self.enter = conv_block(3 * len(config.cameras), first, size=7, stride=STRIDE)
        self.body = UNet(first + 1, config.student)
        self.features = Tap()
        self.heat = nn.Conv2d(first, config.waypoints, 1)
        self.softmax = SpatialSoftmax()

    def see(self, pictures: Tensor) -> Tensor:
        """(B, 3 * cameras, H, W) to features (B, C, H/4, W/4), whatever the target."""
        found: Tensor = self.enter(pictures)
        return found

    def point(self, features: Tensor, target: Tensor) -> Tensor:
        """Features and (B, 2) [m] to heatmaps' features with the target drawn in."""
        rows, columns = features.shape[-2:]
        drawn = heat_of(share_of_image(target, _FRONT), rows, columns, IMAGE_RADIUS)
        found: Tensor = self.body(torch.cat([features, drawn], dim=1))
        return found

    def places(self, features: Tensor) -> Tensor:
        """(B, T, 2) rows and columns as shares of the front picture's sides."""
        found: Tensor = self.softmax(self.heat(features))
        return found


class LbcTeacher(SystemModel):
    """The privileged one, by itself."""

    def __init__(self, config: LbcConfig) -> None:
        super().__init__()
        self.config: LbcConfig = config
        self.teacher = Teacher(config)
        self.target = Tap()

    def forward(self, seen: Seen, state: State | None = None) -> Output:
        points = self.teacher(seen["raster"], self.target(seen["target_point"][:, :2]))
        return Output(waypoints=points)

    def loss(self, output: Output, labels: Labels) -> dict[str, Tensor]:
        """Points, and the action read off a mix of what it says and of the truth."""
        mix = torch.rand(len(output.waypoints), 1, 1, device=output.waypoints.device)
        points = mix * output.waypoints + (1.0 - mix) * labels["waypoints"]
        acted = Output(waypoints=points, action=self.teacher.action(points))
        return {
            "waypoints": waypoint_error(output, labels),
            "action": self.config.action_weight * action_error(acted, labels),
        }

    @property
    def anatomy(self) -> Anatomy:
        extent_m = (GRID.x_min_m, GRID.x_max_m, GRID.y_min_m, GRID.y_max_m)
        return Anatomy(
            groups={"target_point": TokenGroup(tap="target")},
            maps={"raster": FeatureMap(tap="teacher.features", extent_m=extent_m)},
        )


class LbcStudent(TaughtModel):
    """The one with cameras, and the teacher that it learns from, who no longer learns."""

    def __init__(self, config: LbcConfig) -> None:
        super().__init__()
        self.config: LbcConfig = config
        self.teacher = Teacher(config).requires_grad_(False)
        self.student = Student(config)
        self.target = Tap()

    def forward(self, seen: Seen, state: State | None = None) -> Output:
        size = (_FRONT.height, _FRONT.width)
        pictures = [
            F.interpolate(normalised(seen[name]), size, mode="bilinear", align_corners=False)
            for name in self.config.cameras
        ]
        target = self.target(seen["target_point"][:, :2])
        features = self.student.see(torch.cat(pictures, dim=1))
        places = self.student.places(self.student.features(self.student.point(features, target)))
        said = {"target": target, "places": places}
        if self.training:  # where it would go if it were sent elsewhere: to another moment's target
            said["other_target"] = target.roll(1, dims=0)
            said["other_places"] = self.student.places(
                self.student.point(features, said["other_target"])
            )
        return Output(waypoints=metres_of_image(places, _FRONT), said=said)

    def loss(self, output: Output, labels: Labels) -> dict[str, Tensor]:
        """The teacher's points for both targets; how far waypoints are off is told, not learnt."""
        said = output.said or {}
        terms = {
            "waypoints": waypoint_error(output, labels).detach(),
            "points": self._error(said["places"], labels["raster"], said["target"]),
        }
        if "other_places" in said:
            other = self._error(said["other_places"], labels["raster"], said["other_target"])
            terms["other_points"] = other
        return terms

    def _error(self, places: Tensor, raster: Tensor, target: Tensor) -> Tensor:
        """L1 of (B, T, 2) places in the picture to the teacher's, in hundredths of its sides."""
        with torch.no_grad():
            shown = share_of_image(self.teacher(raster, target), _FRONT)
        return 100.0 * (places.float() - shown).abs().sum(dim=2).mean()

    @property
    def anatomy(self) -> Anatomy:
        return Anatomy(
            groups={"target_point": TokenGroup(tap="target")},
            maps={"camera_front": FeatureMap(tap="student.features", camera="camera_front")},
        )


def lbc(config: LbcConfig) -> SystemModel:
    """The teacher, or the student with its teacher."""
    return LbcStudent(config) if config.student else LbcTeacher(config)
