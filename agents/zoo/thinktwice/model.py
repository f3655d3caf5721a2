"""A coarse plan, then in cascade: what comes if it is driven, what is there, and how to mend it.

    sensors -> ground -> maps of four sizes, which learn a teacher's -> vector
    vector, told -> coarse plan -> (predict -> look -> offsets) x layers -> plan

Source: Jia et al., Think Twice before Driving: Towards Scalable Decoders for End-to-End Autonomous
Driving, CVPR 2023. What we changed: sizes; an action is a value and not a distribution, and only
the present one is said; it looks into the ground it predicts, not into pictures.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.driveinsight.rows import SPEED
from agents.explain.protocol import Anatomy, TokenGroup
from agents.networks.blocks import conv_block
from agents.networks.mlp import mlp
from agents.networks.raster_teacher import RasterTeacher, TeacherOutput
from agents.networks.waypoint_heads import StepsHead
from agents.zoo.errors import action_error, waypoint_error
from agents.zoo.eyes import BEV, CHANNELS, BevEyes, Recall
from agents.zoo.raster import GRID, RasterChannel
from agents.zoo.system import Labels, Output, Seen, State, TaughtModel
from agents.zoo.thinktwice.config import ThinkTwiceConfig
from agents.zoo.thinktwice.thinking import Plan, ThinkingAgain, Thought
from agents.zoo.told import ToldEncoder

# As published, relative to the 15 of waypoints and action
FEATURES = (0.25 / 15, 1 / 45, 1 / 60, 1 / 165)
LATENT, SPEED_WEIGHT, FUTURE, TEACHER_FORCED = 0.05 / 15, 1 / 15, 0.25, 1.0
_ROLLED = 1  # the level that is rolled forward


class Pyramid(nn.Module):
    """The ground at four sizes, and as a vector."""

    def __init__(self, config: ThinkTwiceConfig) -> None:
        super().__init__()
        widths = config.levels
        self.levels = nn.ModuleList([conv_block(CHANNELS, widths[0])])
        self.levels.extend(conv_block(fine, coarse, stride=2) for fine, coarse in pairwise(widths))
        self.last = conv_block(widths[-1], 32, stride=2)
        side = BEV.cells // 2 ** len(widths)
        self.flat = nn.Sequential(nn.Linear(32 * side * side, config.width), nn.ReLU())

    def forward(self, bev: Tensor) -> tuple[list[Tensor], Tensor]:
        """(B, C, X, Y) to maps, the finest first, and (B, width)."""
        maps = list[Tensor]()
        for level in self.levels:
            bev = level(bev)
            maps.append(bev)
        return maps, self.flat(self.last(bev).flatten(1))


class ThinkTwice(TaughtModel):
    """The network, and the teacher that it learns features from, who no longer learns."""

    def __init__(self, config: ThinkTwiceConfig) -> None:
        super().__init__()
        self.config: ThinkTwiceConfig = config
        width = config.width
        self.teacher = RasterTeacher(
            len(RasterChannel), GRID.cells, config.teacher, config.teacher_width, config.waypoints
        ).requires_grad_(False)
        self.eyes = BevEyes(config)
        self.recall = Recall(recurrent=False)
        self.pyramid = Pyramid(config)
        self.as_teacher = nn.ModuleList(
            nn.Conv2d(ours, theirs, 1)
            for ours, theirs in zip(
                config.levels, config.teacher[: len(config.levels)], strict=True
            )
        )
        self.latent = nn.Linear(width, config.teacher_width)
        self.speed = nn.Linear(width, 1)
        self.told = ToldEncoder(config.told, config.token)
        self.join = nn.Sequential(mlp(width + len(config.told) * config.token, width), nn.ReLU())
        self.coarse, self.act = StepsHead(width, config.waypoints), nn.Linear(width, 2)
        self.ground = nn.Conv2d(config.levels[_ROLLED], config.rolled, 1)
        self.again = nn.ModuleList(ThinkingAgain(config) for _ in range(config.layers))
        self.future = nn.Conv2d(config.rolled, config.teacher[_ROLLED], 1)

    def forward(self, seen: Seen, state: State | None = None) -> Output:
        bev, _ = self.eyes(seen)
        bev, state = self.recall(bev, seen["odometry"], state)
        maps, vector = self.pyramid(bev)
        known = self.join(torch.cat([vector, self.told(seen).flatten(1)], dim=1))
        ground = self.ground(maps[_ROLLED]).tanh()
        plan = Plan(waypoints=self.coarse(known), action=self.act(known))
        plans = [plan]
        for again in self.again:
            # what was planned is given: it learns to mend it
            plan = Plan(waypoints=self.given(plan.waypoints), action=self.given(plan.action))
            offsets = again(plan, known, ground).offsets
            plan = Plan(
                waypoints=plan.waypoints + offsets.waypoints, action=plan.action + offsets.action
            )
            plans.append(plan)
        said = {f"map{n}": self.as_teacher[n](maps[n]) for n in range(len(maps))}
        said |= {"vector": vector, "known": known, "ground": ground, "speed": seen["speed"]}
        said["waypoints"] = torch.stack([each.waypoints for each in plans], dim=1)
        said["actions"] = torch.stack([each.action.tanh() for each in plans], dim=1)
        return Output(waypoints=plan.waypoints, action=plan.action.tanh(), said=said, state=state)

    def loss(self, output: Output, labels: Labels) -> dict[str, Tensor]:
        said = output.said or {}
        with torch.no_grad():
            taught = self.teacher(labels["raster"], said["speed"] / SPEED)
        earlier = [
            Output(waypoints=waypoints, action=action)
            for waypoints, action in zip(
                said["waypoints"].unbind(1), said["actions"].unbind(1), strict=True
            )
        ]
        return {
            "waypoints": waypoint_error(output, labels),
            "earlier": _sum(waypoint_error(each, labels) for each in earlier[:-1]),
            "action": _sum(action_error(each, labels) for each in earlier),
            "features": self._features(said, taught),
            "speed": SPEED_WEIGHT * F.l1_loss(self.speed(said["vector"]).float(), said["speed"]),
            **self._forced(said, labels),
        }

    def _features(self, said: Labels, taught: TeacherOutput) -> Tensor:
        """How far its maps and its vector are from the teacher's."""
        terms = [
            weight * F.smooth_l1_loss(said[f"map{n}"].float(), taught.features[n])
            for n, weight in enumerate(FEATURES)
        ]
        latent = F.smooth_l1_loss(self.latent(said["vector"]).float(), taught.latent)
        return _sum(terms) + LATENT * latent

    def _forced(self, said: Labels, labels: Labels) -> dict[str, Tensor]:
        """Told the true plan there is nothing to mend, and what comes is what the teacher sees."""
        action = labels["action"].clamp(-0.99, 0.99).atanh()
        truth = Plan(waypoints=labels["waypoints"], action=action)
        with torch.no_grad():
            rasters = labels["future"].float().flatten(0, 1)
            nothing = rasters.new_zeros(len(rasters), 1)
            comes = self.teacher(rasters, nothing).features[_ROLLED]  # (B*T, C, X, Y)
        thoughts = list[Thought](each(truth, said["known"], said["ground"]) for each in self.again)
        mended = [
            (each.offsets.waypoints.abs().sum(dim=2) * labels["valid"]).mean()
            + each.offsets.action.abs().sum(dim=1).mean()
            for each in thoughts
        ]
        off = [
            F.smooth_l1_loss(self.future(each.future.flatten(0, 1)).float(), comes)
            for each in thoughts
        ]
        return {"mended": TEACHER_FORCED * _sum(mended), "future": FUTURE * _sum(off)}

    @property
    def anatomy(self) -> Anatomy:
        groups = self.told.groups("told")
        groups["looked"] = TokenGroup(tap=f"again.{self.config.layers - 1}.seen")
        return Anatomy(groups=groups, maps=self.eyes.maps("eyes"))


def _sum(terms: Iterable[Tensor]) -> Tensor:
    return torch.stack(list(terms)).sum()
