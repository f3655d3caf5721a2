"""Tokens of all views in one transformer; queries say objects, traffic state and waypoints.

Source: Shao et al., Safety-Enhanced Autonomous Driving Using Interpretable Sensor Fusion
Transformer (InterFuser), CoRL 2022. What we changed: sizes; the narrow camera is what its centre
crop was; the query of the traffic asks for the line that governs the lane instead of for junctions.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from agents.driveinsight.config import LidarEncoderConfig
from agents.driveinsight.lidar import Pillars
from agents.driveinsight.rows import METRES, SPEED
from agents.explain.protocol import Anatomy, FeatureMap, Span, TokenGroup
from agents.networks.decoder import DecoderLayer, MixingLayer
from agents.networks.images import normalised
from agents.networks.resnet import ResNet
from agents.networks.taps import Tap
from agents.networks.waypoint_heads import STEP_M
from agents.zoo.interfuser.config import InterfuserConfig
from agents.zoo.interfuser.losses import interfuser_losses
from agents.zoo.raster import GRID
from agents.zoo.system import FAMILY, Labels, Output, Seen, State, SystemModel

SCALES = 4
STRIDE = 32  # pixels to a token, and LiDAR pillars
OBJECT = 8  # numbers of a cell: presence, offset (2), log size (2), sine, cosine, speed
TRAFFIC = 3  # logits: at a line that governs the lane, it shows red or yellow, it is a stop sign's
_SPEEDS = 32  # times that the speed stands beside a cell


class ViewTokens(nn.Module):
    """A view's features to tokens: one for each place, and one for the whole."""

    def __init__(self, inputs: int, places: int, width: int) -> None:
        super().__init__()
        self.project = nn.Conv2d(inputs, width, 1)
        self.place = nn.Parameter(torch.randn(1, places + 1, width) * 0.1)  # and which view it is
        self.tokens = Tap()

    def forward(self, features: Tensor) -> Tensor:
        """(B, C, h, w) to (B, h * w + 1, width)."""
        places = self.project(features).flatten(2).transpose(1, 2)
        whole = places.mean(dim=1, keepdim=True)
        tokens: Tensor = self.tokens(torch.cat([places, whole], dim=1) + self.place)
        return tokens


class Interfuser(SystemModel):
    """The network."""

    def __init__(self, config: InterfuserConfig) -> None:
        super().__init__()
        self.config: InterfuserConfig = config
        depths, width = (1,) * SCALES, config.width
        self.pillars = Pillars(LidarEncoderConfig(heights_m=config.heights_m), GRID)
        self.image = ResNet("basic", depths, config.image_width)
        self.lidar = ResNet("basic", depths, config.lidar_width, inputs=self.pillars.channels)
        self.shown = nn.ModuleDict({name: Tap() for name in self.places})
        last = dict.fromkeys(config.cameras, self.image.channels[-1])
        last["lidar"] = self.lidar.channels[-1]
        self.views = nn.ModuleDict(
            {name: ViewTokens(last[name], count, width) for name, count in self.places.items()}
        )
        self.encoder = nn.ModuleList(
            MixingLayer(width, config.heads) for _ in range(config.encoder_layers)
        )
        queries = config.cells**2 + 1 + config.waypoints
        self.query = nn.Parameter(torch.randn(1, queries, width) * 0.5)
        self.decoder = nn.ModuleList(
            DecoderLayer(width, config.heads) for _ in range(config.decoder_layers)
        )
        self.norm, self.memory = nn.LayerNorm(width), nn.LayerNorm(width)
        self.speed, self.target = Tap(), Tap()
        self.objects = nn.Sequential(
            nn.Linear(width + _SPEEDS, 64), nn.ReLU(), nn.Linear(64, OBJECT)
        )
        self.traffic = nn.Linear(width, TRAFFIC)
        self.start = nn.Linear(2, config.gru)
        self.gru = nn.GRU(width, config.gru, batch_first=True)
        self.step = nn.Linear(config.gru, 2)

    @property
    def places(self) -> dict[str, int]:
        """How many tokens of places each view has."""
        sizes = {camera.name: (camera.height, camera.width) for camera in FAMILY.cameras}
        sizes["lidar"] = (self.pillars.sides, self.pillars.sides)
        chosen = {name: sizes[name] for name in (*self.config.cameras, "lidar")}
        return {name: -(-h // STRIDE) * -(-w // STRIDE) for name, (h, w) in chosen.items()}

    def forward(self, seen: Seen, state: State | None = None) -> Output:
        views = [
            self._view(name, self.image, normalised(seen[name])) for name in self.config.cameras
        ]
        views.append(self._view("lidar", self.lidar, self.pillars(seen["lidar"])))
        tokens = torch.cat(views, dim=1)  # (B, N, width)
        for layer in self.encoder:
            tokens = layer(tokens)
        tokens = self.memory(tokens)
        query = self.query.expand(len(tokens), -1, -1)
        for layer in self.decoder:
            query = layer(query, tokens)
        query = self.norm(query)
        cells, traffic, steps = query.split([self.config.cells**2, 1, self.config.waypoints], dim=1)
        speed = self.speed(seen["speed"] / SPEED)  # (B, 1): of objects it is told, of the way not
        beside = speed[:, None].expand(-1, cells.shape[1], _SPEEDS)
        return Output(
            waypoints=self._plan(steps, self.target(seen["target_point"][:, :2])),
            said={
                "objects": self.objects(torch.cat([cells, beside], dim=2)),  # (B, cells², OBJECT)
                "traffic": self.traffic(traffic[:, 0]),  # (B, TRAFFIC)
            },
        )

    def _view(self, name: str, branch: ResNet, pixels: Tensor) -> Tensor:
        """(B, N, width) of a view."""
        features = branch.stem(pixels)
        for scale in range(SCALES):
            features = branch.layer(scale, features)
            if scale == 1:  # at stride 8
                features = self.shown[name](features)
        tokens: Tensor = self.views[name](features)
        return tokens

    def _plan(self, steps: Tensor, target: Tensor) -> Tensor:
        """(B, T, 2) by a GRU that begins with the target point and reads a query at each step."""
        found, _ = self.gru(steps, self.start(target / METRES)[None])
        return (STEP_M * self.step(found)).cumsum(dim=1)

    def loss(self, output: Output, labels: Labels) -> dict[str, Tensor]:
        return interfuser_losses(output, labels, self.config.cells)

    @property
    def anatomy(self) -> Anatomy:
        groups, spans = dict[str, TokenGroup](), self._spans()
        for name, span in spans.items():
            groups[name] = TokenGroup(tap=f"views.{name}.tokens", keys=span)
        groups["speed"] = TokenGroup(tap="speed")
        groups["target_point"] = TokenGroup(tap="target")
        extent_m = (GRID.x_min_m, GRID.x_max_m, GRID.y_min_m, GRID.y_max_m)
        maps = {name: FeatureMap(tap=f"shown.{name}", camera=name) for name in self.config.cameras}
        maps["lidar"] = FeatureMap(tap="shown.lidar", extent_m=extent_m)
        attention = (f"decoder.{n}.attention.weights" for n in range(self.config.decoder_layers))
        return Anatomy(groups=groups, attention=tuple(attention), maps=maps)

    def _spans(self) -> dict[str, Span]:
        """Where each view's tokens stand among all."""
        spans, first = dict[str, Span](), 0
        for name, count in self.places.items():
            spans[name] = (first, first + count + 1)
            first += count + 1
        return spans
