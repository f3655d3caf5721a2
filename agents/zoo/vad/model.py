"""A scene as vectors: queries for others and for lines; the ego's asks the former, then the latter.

Source: Jiang et al., VAD: Vectorized Scene Representation for Efficient Autonomous Driving, ICCV
2023. What we changed: sizes; pictures are lifted by depth instead of by queries of the ground; that
is told the speed, not all that the bus of the car says; both kinds of query go through the same
layers; a narrow camera ahead.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from agents.driveinsight.rows import METRES
from agents.explain.protocol import Anatomy, TokenGroup
from agents.networks.blocks import conv_block
from agents.networks.decoder import DecoderLayer, MixingLayer
from agents.networks.looking import features_at
from agents.networks.mlp import mlp
from agents.networks.taps import Tap
from agents.networks.waypoint_heads import STEP_M
from agents.zoo.commands import COMMANDS, command_of
from agents.zoo.eyes import BEV, CHANNELS, BevEyes, Recall
from agents.zoo.system import Labels, Output, Seen, State, SystemModel
from agents.zoo.told import ToldEncoder
from agents.zoo.vad.config import VadConfig
from agents.zoo.vad.losses import vad_losses
from di_envs.town.map_chunks import POINTS, MapKind

BOX = 8  # x, y, log length, log width, sine, cosine of the heading, velocity
_COARSER = 2  # cells of the ground to a token
_SIDE = BEV.cells // _COARSER
_WAVES_M = (4.0, 8.0, 16.0, 32.0, 64.0, 128.0)


class Places(nn.Module):
    """Places on the ground as waves of several lengths, the same for cells and for queries."""

    waves: Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        waves = 2.0 * math.pi / torch.tensor(_WAVES_M)
        self.register_buffer("waves", waves, persistent=False)
        self.enter = nn.Linear(4 * len(_WAVES_M), width)

    def forward(self, places: Tensor) -> Tensor:
        """(..., 2) x, y [m] to (..., width)."""
        phases = (places[..., None] * self.waves).flatten(-2)
        found: Tensor = self.enter(torch.cat([phases.sin(), phases.cos()], dim=-1))
        return found


class Queries(nn.Module):
    """Queries for others and for lines, which look at the ground, to vectors."""

    cells: Tensor

    def __init__(self, config: VadConfig) -> None:
        super().__init__()
        self.config, width = config, config.width
        count = config.agents + config.lines
        self.query = nn.Parameter(torch.randn(1, count, width) * 0.5)
        spread = torch.rand(1, count, 2) * 2.0 - torch.tensor([0.4, 1.0])
        self.anchor = nn.Parameter(spread)  # where each looks for something, in `METRES`
        self.there = nn.Linear(width, width)
        along = (torch.arange(_SIDE) + 0.5) / _SIDE
        x = BEV.x_min_m + (BEV.x_max_m - BEV.x_min_m) * along
        y = BEV.y_min_m + (BEV.y_max_m - BEV.y_min_m) * along
        cells = torch.cartesian_prod(x, y)  # (_SIDE * _SIDE, 2) centres, x by y
        self.register_buffer("cells", cells, persistent=False)
        self.mix = nn.ModuleList(MixingLayer(width, config.heads) for _ in range(config.layers))
        self.look = nn.ModuleList(DecoderLayer(width, config.heads) for _ in range(config.layers))
        self.agents, self.lines = Tap(), Tap()
        self.box = mlp_to(width, 1 + BOX)
        self.motion = mlp_to(width, config.modes * (2 * config.waypoints + 1))
        self.line = mlp_to(width, len(MapKind) + 2 * POINTS)

    def forward(self, ground: Tensor, where: Places) -> dict[str, Tensor]:
        """(B, width, X, Y) to `agents`, `lines` (B, Q, width), and what they say; see `_said`.

        Each begins with its place and with what is there, as reference points have it in Zhu et
        al., Deformable DETR, ICLR 2021.
        """
        places = METRES * self.anchor.expand(len(ground), -1, -1)
        query = self.query + where(places) + self.there(features_at(ground, places, BEV))
        ground = ground.flatten(2).transpose(1, 2) + where(self.cells)  # (B, N, width)
        for mix, look in zip(self.mix, self.look, strict=True):
            query = look(mix(query), ground)
        parts = query.split([self.config.agents, self.config.lines], dim=1)
        return self._said(self.agents(parts[0]), self.lines(parts[1]))

    def _said(self, agents: Tensor, lines: Tensor) -> dict[str, Tensor]:
        """Vectors.

        Returns:
            The queries; `presence` (B, A) logits; `boxes` (B, A, BOX); `ways` (B, A, modes, T, 2)
            where they will be, and `mode` (B, A, modes) logits of which; `kinds` (B, L, MapKind)
            logits; `points` (B, L, POINTS, 2) [m].
        """
        config, anchors = self.config, self.anchor.split([agents.shape[1], lines.shape[1]], dim=1)
        boxes, motion, line = self.box(agents), self.motion(agents), self.line(lines)
        place = METRES * (anchors[0] + boxes[..., 1:3])
        steps = motion[..., config.modes :].unflatten(2, (config.modes, config.waypoints, 2))
        points = METRES * (
            anchors[1][:, :, None] + line[..., len(MapKind) :].unflatten(2, (POINTS, 2))
        )
        return {
            "agents": agents,
            "lines": lines,
            "presence": boxes[..., 0],
            "boxes": torch.cat([place, boxes[..., 3:]], dim=2),
            "ways": place[:, :, None, None] + (STEP_M * steps).cumsum(dim=3),
            "mode": motion[..., : config.modes],
            "kinds": line[..., : len(MapKind)],
            "points": points,
        }


def mlp_to(width: int, outputs: int) -> nn.Sequential:
    """Two layers and one more."""
    return nn.Sequential(mlp(width, width), nn.ReLU(), nn.Linear(width, outputs))


class Vad(SystemModel):
    """The network."""

    def __init__(self, config: VadConfig) -> None:
        super().__init__()
        self.config: VadConfig = config
        width = config.width
        self.eyes = BevEyes(config)
        self.moving = ToldEncoder(("speed",), CHANNELS)
        self.recall = Recall(recurrent=True)
        self.enter = conv_block(CHANNELS, width, stride=_COARSER)
        self.where = Places(width)
        self.queries = Queries(config)
        self.ego = nn.Parameter(torch.randn(1, 1, width) * 0.5)
        # vectors, not only queries, are what the ego asks
        self.of_agents = nn.Linear(1 + BOX, width)
        self.of_lines = nn.Linear(len(MapKind) + 2 * POINTS, width)
        self.ask_agents = DecoderLayer(width, config.heads)
        self.ask_lines = DecoderLayer(width, config.heads)
        self.plan = nn.Sequential(
            mlp(2 * width, 2 * width),
            nn.ReLU(),
            nn.Linear(2 * width, COMMANDS * config.waypoints * 2),
        )
        self.command = Tap()

    def forward(self, seen: Seen, state: State | None = None) -> Output:
        bev, _ = self.eyes(seen)
        bev = bev + self.moving(seen)[:, 0, :, None, None]
        bev, state = self.recall(bev, seen["odometry"], state)
        said = self.queries(self.enter(bev), self.where)
        ego = self.ego.expand(len(bev), -1, -1)
        to_agents = self.ask_agents(ego, said["agents"] + self.of_agents(self._vectors(said)))
        to_lines = self.ask_lines(to_agents, said["lines"] + self.of_lines(self._polylines(said)))
        plans = self.plan(torch.cat([to_agents, to_lines], dim=2))[:, 0]
        plans = plans.unflatten(1, (COMMANDS, self.config.waypoints, 2))
        chosen = self.command(command_of(seen["command"]))  # (B, COMMANDS)
        steps = (plans * chosen[:, :, None, None]).sum(dim=1)
        return Output(waypoints=(STEP_M * steps.float()).cumsum(dim=1), said=said, state=state)

    def _vectors(self, said: dict[str, Tensor]) -> Tensor:
        """(B, A, 1 + BOX) about 1 in size; boxes are not learnt from the plan."""
        boxes = self.given(said["boxes"])
        there = self.given(said["presence"]).sigmoid()[..., None]
        return torch.cat([there, boxes[..., :2] / METRES, boxes[..., 2:]], dim=2)

    def _polylines(self, said: dict[str, Tensor]) -> Tensor:
        """(B, L, MapKind + 2 * POINTS) likewise."""
        kinds = self.given(said["kinds"]).softmax(dim=2)
        return torch.cat([kinds, self.given(said["points"]).flatten(2) / METRES], dim=2)

    def loss(self, output: Output, labels: Labels) -> dict[str, Tensor]:
        return vad_losses(output, labels)

    @property
    def anatomy(self) -> Anatomy:
        groups = {
            "agents": TokenGroup(tap="queries.agents"),
            "lines": TokenGroup(tap="queries.lines"),
            "command": TokenGroup(tap="command"),
            **self.moving.groups("moving"),
        }
        return Anatomy(groups=groups, maps=self.eyes.maps("eyes"))
