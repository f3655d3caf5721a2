"""Cameras to the ground, over time; what comes as occupancy; the cheapest path, refined.

    cameras -> ground -> accumulated -> rolled forward -> occupancy, learnt cost --+
                                                                                   v
    speed, command -> many paths -----------------------------------------> the cheapest
    front camera, target point, the cheapest path -> GRU -> waypoints

Source: Hu et al., ST-P3: End-to-end Vision-based Autonomous Driving via Spatial-Temporal Feature
Learning, ECCV 2022. What we changed: sizes; the future is rolled forward at half as many cells; its
noise is drawn from what the present shows alone; a narrow camera ahead; the GRU adds to the path.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.driveinsight.memory import warp
from agents.driveinsight.rows import METRES
from agents.driveinsight.semantics import BevClass
from agents.explain.protocol import Anatomy, TokenGroup
from agents.networks.blocks import conv_block
from agents.networks.spatial_gru import SpatialGru
from agents.networks.taps import Tap
from agents.networks.waypoint_heads import STEP_M
from agents.zoo.commands import command_of
from agents.zoo.errors import waypoint_error
from agents.zoo.eyes import BEV, CHANNELS, BevEyes
from agents.zoo.raster import RasterChannel
from agents.zoo.st_p3.config import StP3Config
from agents.zoo.st_p3.paths import path_costs, sampled_paths
from agents.zoo.system import Labels, Output, Seen, State, SystemModel

DISCOUNT = 0.5  # of what was seen a moment before
VEHICLES, WALKERS, LINES, ROAD = 2.0, 10.0, 5.0, 1.0  # how much more what is there weighs
HARDEST = 0.25  # share of the cells that occupancy is learnt from
MARGIN = 0.5
_LEARNT = 100.0  # times that the learnt cost counts
_MOST = 10.0  # of it, in a cell


class Rolling(nn.Module):
    """The ground of now to that of the next moments, by two GRUs whose maps are averaged.

    One is told noise that stands for how it may go on, the other what it last said itself.
    """

    def __init__(self, config: StP3Config) -> None:
        super().__init__()
        width = config.future
        self.steps = config.waypoints
        self.enter = conv_block(CHANNELS, width, stride=2)
        self.noise = nn.Linear(width, 2 * config.latent)
        self.drawn, self.plain = SpatialGru(config.latent, width), SpatialGru(width, width)
        self.leave = nn.Conv2d(width, CHANNELS, 1)
        self.mix = conv_block(CHANNELS, CHANNELS)

    def forward(self, now: Tensor) -> Tensor:
        """(B, C, X, Y) to (B, T, C, X, Y)."""
        start = self.enter(now)
        mean, spread = self.noise(start.mean(dim=(2, 3))).chunk(2, dim=1)
        if self.training:
            mean = mean + (0.5 * spread.clamp(-5.0, 1.0)).exp() * torch.randn_like(mean)
        told = mean[:, :, None, None].expand(-1, -1, *start.shape[2:])
        drawn, plain, maps = start, start, list[Tensor]()
        for _ in range(self.steps):
            drawn, plain = self.drawn(told, drawn), self.plain(plain, plain)
            coarse = self.leave(0.5 * (drawn + plain))
            maps.append(self.mix(now + F.interpolate(coarse, scale_factor=2.0, mode="nearest")))
        return torch.stack(maps, dim=1)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Logits on `BEV`, and the learnt cost.

    Attributes:
        now: (B, 4, X, Y) of vehicles, walkers, lines, road.
        later: (B, T, 2, X, Y) of vehicles and walkers.
        cost: (B, T, 1, X, Y) 0 or more.
    """

    now: Tensor
    later: Tensor
    cost: Tensor

    def priced(self) -> Tensor:
        """(B, T, 4, X, Y) as `path_costs` takes it; only the learnt cost learns from paths."""
        somebody = self.later.detach().sigmoid().amax(dim=2, keepdim=True)
        lines, road = self.now.detach().sigmoid()[:, None, 2:].chunk(2, dim=2)
        still = (each.expand_as(somebody) for each in (lines, road))
        return torch.cat([_LEARNT / _MOST * self.cost, somebody, *still], dim=2).float()


class StP3(SystemModel):
    """The network."""

    def __init__(self, config: StP3Config) -> None:
        super().__init__()
        self.config: StP3Config = config
        self.eyes = BevEyes(config)
        self.temporal = nn.Sequential(
            conv_block(CHANNELS, CHANNELS), conv_block(CHANNELS, CHANNELS)
        )
        self.roll = Rolling(config)
        self.now = nn.Conv2d(CHANNELS, 4, 1)
        self.later = nn.Conv2d(CHANNELS, 2, 1)
        self.cost = nn.Conv2d(CHANNELS, 1, 1)
        self.speed, self.command, self.target = Tap(), Tap(), Tap()
        self.start = nn.Linear(CHANNELS, config.gru)
        self.cell = nn.GRUCell(6, config.gru)
        self.step = nn.Linear(config.gru, 2)
        nn.init.zeros_(self.step.weight)  # it begins with the path as it is
        nn.init.zeros_(self.step.bias)

    def forward(self, seen: Seen, state: State | None = None) -> Output:
        bev, ahead = self.eyes(seen)
        if state is not None:
            bev = bev + DISCOUNT * warp(state[0], state[1], seen["odometry"], BEV)
        now = self.temporal(bev)
        later = self.roll(now)  # (B, T, C, X, Y)
        flat, sizes = later.flatten(0, 1), later.shape[:2]
        scene = Scene(
            now=self.now(now),
            later=self.later(flat).unflatten(0, sizes),
            cost=(_MOST * self.cost(flat).sigmoid()).unflatten(0, sizes),
        )
        speed = self.speed(seen["speed"])
        command = self.command(command_of(seen["command"]))
        paths = sampled_paths(speed, command, self.config.waypoints)  # (B, K, T, 2)
        learnt, made = path_costs(paths, speed, scene.priced())
        cheapest = (learnt + made).argmin(dim=1)
        path = paths[torch.arange(len(paths), device=paths.device), cheapest]  # (B, T, 2)
        said = {"now": scene.now, "later": scene.later, "cost": scene.cost}
        said |= {"speed": speed, "paths": paths, "costs": learnt + made}
        waypoints = self._refine(ahead, path, self.target(seen["target_point"][:, :2]))
        return Output(waypoints=waypoints, said=said, state=(bev, seen["odometry"]))

    def _refine(self, ahead: Tensor, path: Tensor, target: Tensor) -> Tensor:
        """(B, T, 2) by a GRU that begins with what the front camera shows, and adds to the path."""
        latent, moved, places = self.start(ahead), torch.zeros_like(target), list[Tensor]()
        for point in path.unbind(dim=1):
            latent = self.cell(torch.cat([moved, point, target], dim=1) / METRES, latent)
            moved = moved + STEP_M * self.step(latent)
            places.append(point + moved)
        return torch.stack(places, dim=1)

    def loss(self, output: Output, labels: Labels) -> dict[str, Tensor]:
        said = output.said or {}
        now, later, future = said["now"].float(), said["later"].float(), labels["future"].float()
        shown = [
            future[:, :, [channel]] for channel in (RasterChannel.VEHICLE, RasterChannel.WALKER)
        ]
        comes = torch.cat(shown, dim=2)  # (B, T, 2, 96, 96)
        semantics = labels["semantics"]
        true = [
            semantics == BevClass.VEHICLE,
            semantics == BevClass.WALKER,
            semantics == BevClass.LINE,
            (semantics >= BevClass.ROAD) & (semantics != BevClass.WALKER),
        ]
        lines, road = (
            _occupied(now[:, n], true[n].float(), w, 1.0) for n, w in ((2, LINES), (3, ROAD))
        )
        people = [
            _occupied(now[:, n], true[n].float(), weight, HARDEST)
            + _occupied(later[:, :, n].flatten(0, 1), comes[:, :, n].flatten(0, 1), weight, HARDEST)
            for n, weight in ((0, VEHICLES), (1, WALKERS))
        ]
        return {
            "waypoints": waypoint_error(output, labels),
            "vehicles": people[0],
            "walkers": people[1],
            "lines": lines,
            "road": road,
            "margin": MARGIN * self._margin(said, labels),
        }

    def _margin(self, said: Labels, labels: Labels) -> Tensor:
        """How far the truth is not cheaper than any path, by as much as that one is off [m]."""
        scene = Scene(now=said["now"], later=said["later"], cost=said["cost"])
        truth, valid = labels["waypoints"], labels["valid"]
        learnt, made = path_costs(truth[:, None], said["speed"], scene.priced())
        off = (said["paths"] - truth[:, None]).square().sum(dim=3).clamp(min=1e-6).sqrt()
        off = (off * valid[:, None]).mean(dim=2)  # (B, K)
        worst = (learnt + made - said["costs"] + off).amax(dim=1)
        return (F.relu(worst) * valid.amin(dim=1)).mean()

    @property
    def anatomy(self) -> Anatomy:
        groups = {name: TokenGroup(tap=name) for name in ("speed", "command")}
        groups["target_point"] = TokenGroup(tap="target")
        return Anatomy(groups=groups, maps=self.eyes.maps("eyes"))


def _occupied(logits: Tensor, fine: Tensor, weight: float, hardest: float) -> Tensor:
    """Cross-entropy of (N, X, Y) logits over the hardest cells; what is there weighs more."""
    truth = F.max_pool2d(fine[:, None], fine.shape[1] // logits.shape[1])[:, 0]
    wrong = F.binary_cross_entropy_with_logits(
        logits, truth, pos_weight=logits.new_tensor(weight), reduction="none"
    ).flatten(1)
    return wrong.topk(int(hardest * wrong.shape[1]), dim=1).values.mean()
