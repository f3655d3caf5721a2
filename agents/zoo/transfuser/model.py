"""Images and LiDAR in two branches that attend to each other at four scales; a GRU plans.

Source: Prakash, Chitta and Geiger, Multi-Modal Fusion Transformer for End-to-End Autonomous Driving
(TransFuser), CVPR 2021: the model whose score the paper copies. What we changed: sizes; a second,
narrow camera ahead through the same branch, as lamps are too small in the wide one.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.driveinsight.config import LidarEncoderConfig
from agents.driveinsight.lidar import Pillars
from agents.driveinsight.rows import SPEED
from agents.explain.protocol import Anatomy, FeatureMap, TokenGroup
from agents.networks.decoder import MixingLayer
from agents.networks.images import normalised
from agents.networks.resnet import ResNet
from agents.networks.taps import Tap
from agents.networks.waypoint_heads import GruHead
from agents.zoo.errors import waypoint_error
from agents.zoo.raster import GRID
from agents.zoo.system import Labels, Output, Seen, State, SystemModel
from agents.zoo.transfuser.config import TransfuserConfig

SCALES = 4
_SHOWN = 1  # the scale whose features are shown: at stride 8


class ScaleFusion(nn.Module):
    """Maps of all branches at one scale: pooled to anchors, mixed by attention, added back."""

    def __init__(self, width: int, config: TransfuserConfig) -> None:
        super().__init__()
        image, lidar = config.image_anchors, config.lidar_anchors
        self.anchors = (*((image,) * len(config.cameras)), lidar)
        count = sum(rows * columns for rows, columns in self.anchors)
        self.place = nn.Parameter(torch.randn(1, count, width) * 0.02)
        self.speed = nn.Linear(1, width)
        self.tokens = Tap()
        self.layers = nn.ModuleList(MixingLayer(width, config.heads) for _ in range(config.layers))
        self.norm = nn.LayerNorm(width)

    def forward(self, maps: Sequence[Tensor], speed: Tensor) -> list[Tensor]:
        """Fuses.

        Args:
            maps: (B, C, H_i, W_i) of each camera, and of the LiDAR.
            speed: (B, 1).

        Returns:
            The maps, each with what the others say.
        """
        pooled = [
            F.adaptive_avg_pool2d(features, anchors).flatten(2).transpose(1, 2)
            for features, anchors in zip(maps, self.anchors, strict=True)
        ]
        tokens = torch.cat(pooled, dim=1) + self.place + self.speed(speed)[:, None]
        tokens = self.tokens(tokens)  # (B, N, C)
        for layer in self.layers:
            tokens = layer(tokens)
        parts = self.norm(tokens).split([part.shape[1] for part in pooled], dim=1)
        return [
            features + _spread(part, anchors, features)
            for part, anchors, features in zip(parts, self.anchors, maps, strict=True)
        ]


def _spread(tokens: Tensor, anchors: tuple[int, int], like: Tensor) -> Tensor:
    """(B, rows * columns, C) tokens of anchors, as a map of the size of another."""
    coarse = tokens.transpose(1, 2).unflatten(2, anchors)
    return F.interpolate(coarse, like.shape[-2:], mode="bilinear", align_corners=False)


class Transfuser(SystemModel):
    """The network."""

    def __init__(self, config: TransfuserConfig) -> None:
        super().__init__()
        self.config: TransfuserConfig = config
        depths, widths = (1,) * SCALES, [config.width * 2**n for n in range(SCALES)]
        self.pillars = Pillars(LidarEncoderConfig(heights_m=config.heights_m), GRID)
        self.image = ResNet("basic", depths, config.width)
        self.lidar = ResNet("basic", depths, config.width, inputs=self.pillars.channels)
        self.fusions = nn.ModuleList(ScaleFusion(width, config) for width in widths)
        self.shown = nn.ModuleDict({name: Tap() for name in (*config.cameras, "lidar")})
        self.speed, self.target = Tap(), Tap()
        self.join = nn.Sequential(
            nn.Linear(widths[-1], 2 * config.gru),
            nn.ReLU(),
            nn.Linear(2 * config.gru, config.gru),
            nn.ReLU(),
        )
        self.plan = GruHead(config.gru, config.waypoints)

    def forward(self, seen: Seen, state: State | None = None) -> Output:
        speed = self.speed(seen["speed"] / SPEED)
        branches = [self.image] * len(self.config.cameras) + [self.lidar]
        inputs = [normalised(seen[name]) for name in self.config.cameras]
        inputs.append(self.pillars(seen["lidar"]))
        maps = [branch.stem(x) for branch, x in zip(branches, inputs, strict=True)]
        for scale, fusion in enumerate(self.fusions):
            maps = [branch.layer(scale, x) for branch, x in zip(branches, maps, strict=True)]
            if scale == _SHOWN:
                maps = [tap(x) for tap, x in zip(self.shown.values(), maps, strict=True)]
            maps = fusion(maps, speed)
        latent = torch.stack([x.mean(dim=(2, 3)) for x in maps]).sum(dim=0)  # (B, 8 * width)
        target = self.target(seen["target_point"][:, :2])
        return Output(waypoints=self.plan(self.join(latent), target))

    def loss(self, output: Output, labels: Labels) -> dict[str, Tensor]:
        return {"waypoints": waypoint_error(output, labels)}

    @property
    def anatomy(self) -> Anatomy:
        config, tap = self.config, f"fusions.{SCALES - 1}.tokens"
        rows, columns = config.image_anchors
        image, ends = len(config.cameras) * rows * columns, config.lidar_anchors
        camera, lidar = (0, image), (image, image + ends[0] * ends[1])
        groups = {
            "cameras": TokenGroup(tap=tap, rows=camera, keys=camera),
            "lidar": TokenGroup(tap=tap, rows=lidar, keys=lidar),
            "speed": TokenGroup(tap="speed"),
            "target_point": TokenGroup(tap="target"),
        }
        attention = (
            f"fusions.{scale}.layers.{layer}.layer.attention.weights"
            for scale in range(SCALES)
            for layer in range(config.layers)
        )
        extent_m = (GRID.x_min_m, GRID.x_max_m, GRID.y_min_m, GRID.y_max_m)
        maps = {name: FeatureMap(tap=f"shown.{name}", camera=name) for name in config.cameras}
        maps["lidar"] = FeatureMap(tap="shown.lidar", extent_m=extent_m)
        return Anatomy(groups=groups, attention=tuple(attention), maps=maps)
