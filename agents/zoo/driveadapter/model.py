"""What is seen as the masks that a frozen teacher reads; adapters mend its features as it reads.

    sensors -> ground -> masks -> teacher's conv -> adapter -> conv -> adapter … -> latent -> action
                  +---- raw, at each size ---^                                       +-> waypoints

Source: Jia et al., DriveAdapter: Breaking the Coupling Barrier of Perception and Planning in
End-to-End Autonomous Driving, ICCV 2023. What we changed: sizes; a U-Net says masks, not queries;
the teacher is `roach-raster`, whose view has velocities and whose action is a value.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.driveinsight.rows import SPEED
from agents.explain.protocol import Anatomy, FeatureMap, TokenGroup
from agents.networks.blocks import SqueezeExcitation, conv_block
from agents.networks.raster_teacher import RasterTeacher
from agents.networks.taps import Tap
from agents.networks.waypoint_heads import StepsHead
from agents.zoo.driveadapter.config import DriveAdapterConfig
from agents.zoo.driveadapter.masks import MaskHead, drawn_route, mask_losses
from agents.zoo.errors import waypoint_error
from agents.zoo.eyes import CHANNELS, EXTENT_M, BevEyes, Recall
from agents.zoo.raster import GRID, RasterChannel
from agents.zoo.system import Labels, Output, Seen, State, TaughtModel

# As published, relative to the waypoints' 10
FEATURES = (2.0, 1.0, 0.5, 0.2, 0.1)
LATENT, ACTION, ENTROPY, DICE, VELOCITY = 0.25, 0.2, 0.2, 0.5, 0.2
_BENDING = 1.5  # power by which the error of an action counts more in turns


class Adapter(nn.Module):
    """A frozen feature and the ground at its size, to a feature that has been mended.

    The last layer begins at zero: the teacher begins as it was.
    """

    def __init__(self, frozen: int, raw: int) -> None:
        super().__init__()
        self.mix = nn.Sequential(
            conv_block(frozen + raw, frozen, size=1), SqueezeExcitation(frozen)
        )
        self.out = nn.Conv2d(frozen, frozen, 1)
        for parameter in self.out.parameters():
            nn.init.zeros_(parameter)

    def forward(self, frozen: Tensor, raw: Tensor) -> Tensor:
        """(B, C, X, Y) and (B, C', X, Y) to (B, C, X, Y)."""
        return frozen + self.out(self.mix(torch.cat([frozen, raw], dim=1)))


class DriveAdapter(TaughtModel):
    """The network, with the teacher that acts inside it and no longer learns."""

    teacher: RasterTeacher

    def __init__(self, config: DriveAdapterConfig) -> None:
        super().__init__()
        self.config: DriveAdapterConfig = config
        raw, widths, width = config.raw, config.teacher, config.teacher_width
        self.teacher = RasterTeacher(
            len(RasterChannel), GRID.cells, widths, width, config.waypoints
        ).requires_grad_(False)
        self.eyes = BevEyes(config)
        self.recall = Recall(recurrent=False)
        self.masks = MaskHead(CHANNELS, config.masks)
        self.raw = nn.ModuleList(
            conv_block(raw if n else CHANNELS, raw, stride=2 if n else 1)
            for n in range(len(widths))
        )
        self.adapters = nn.ModuleList(Adapter(channels, raw) for channels in widths)
        self.adapt_latent = _adapter_of_vectors(width + raw, width)
        self.adapt_action = _adapter_of_vectors(width + raw, 2)
        self.route, self.speed = Tap(), Tap()
        side = -(-GRID.cells // 2 ** len(widths))
        self.join = nn.Sequential(nn.Linear(raw * side * side + width, config.width), nn.ReLU())
        self.plan = StepsHead(config.width, config.waypoints)

    def forward(self, seen: Seen, state: State | None = None) -> Output:
        bev, _ = self.eyes(seen)
        bev, state = self.recall(bev, seen["odometry"], state)
        route = self.route(drawn_route(seen["routing"]))
        masks, view = self.masks(bev, route)
        speed = self.speed(seen["speed"] / SPEED)
        features, raw = list[Tensor](), bev
        for conv, enter, adapter in zip(self.teacher.convs, self.raw, self.adapters, strict=True):
            raw = enter(raw)
            view = adapter(conv(view).relu(), raw)
            features.append(view)
        around = raw.mean(dim=(2, 3))  # (B, raw)
        latent = self.teacher.join(
            torch.cat([self.teacher.view(view.flatten(1)), self.teacher.state(speed)], dim=1)
        )
        latent = latent + self.adapt_latent(torch.cat([latent, around], dim=1))
        policy = self.teacher.action[:-1](latent)  # before it is bent into -1..1
        action = (policy + self.adapt_action(torch.cat([latent, around], dim=1))).tanh()
        joined = self.join(torch.cat([raw.flatten(1), self.given(latent)], dim=1))
        said = {f"feature{n}": feature for n, feature in enumerate(features)}
        said |= {"latent": latent, "masks": masks, "speed": speed}
        return Output(waypoints=self.plan(joined), action=action, said=said, state=state)

    def loss(self, output: Output, labels: Labels) -> dict[str, Tensor]:
        said = output.said or {}
        assert output.action is not None, "it says an action"
        with torch.no_grad():
            taught = self.teacher(labels["raster"], said["speed"])
        features = [
            weight * F.smooth_l1_loss(said[f"feature{n}"].float(), taught.features[n])
            for n, weight in enumerate(FEATURES)
        ]
        entropy, dice, velocity = mask_losses(said["masks"], labels["raster"])
        bends = (1.0 + labels["action"][:, 1:].abs()) ** _BENDING
        wrong = (output.action.float() - labels["action"]).abs() * bends
        return {
            "waypoints": waypoint_error(output, labels),
            "action": ACTION * wrong.sum(dim=1).mean(),
            "features": torch.stack(features).sum(),
            "latent": LATENT * F.smooth_l1_loss(said["latent"].float(), taught.latent),
            "masks": ENTROPY * entropy,
            "dice": DICE * dice,
            "velocity": VELOCITY * velocity,
        }

    @property
    def anatomy(self) -> Anatomy:
        maps = self.eyes.maps("eyes")
        maps["raster"] = FeatureMap(tap="masks.raster", extent_m=EXTENT_M)
        groups = {"routing": TokenGroup(tap="route"), "speed": TokenGroup(tap="speed")}
        return Anatomy(groups=groups, maps=maps)


def _adapter_of_vectors(inputs: int, outputs: int) -> nn.Sequential:
    """Two layers, of which the last begins at zero."""
    last = nn.Linear(96, outputs)
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    return nn.Sequential(nn.Linear(inputs, 96), nn.ReLU(), last)
