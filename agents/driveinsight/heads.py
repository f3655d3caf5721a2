"""What the BEV features say: semantics, objects with velocity, and the signal that governs.

Source: objects as peaks of a heatmap, Yin et al., Center-based 3D Object Detection and Tracking
(CenterPoint), CVPR 2021. What we changed: the velocity is over the ground, as the ego's own motion
is known; the governing signal is a place among all cells or none, and a state that lamps found in
the sharpest camera and the features at that place decide.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.driveinsight.semantics import BevClass
from agents.networks.blocks import conv_block
from agents.networks.mlp import mlp
from agents.networks.taps import Tap
from di_envs.world.kinds import ActorKind

BOX = 8  # offset (2), log size (2), sine and cosine of the heading, velocity (2)
SPEED_MPS = 10.0  # velocities are told in these
STATES = 4  # red, yellow, green, stop sign
_RARE = -math.log(99.0)  # a bias for what one cell in a hundred shows


class ObjectClass(IntEnum):
    """What a heatmap is of."""

    VEHICLE = 0
    BICYCLE = 1
    WALKER = 2


# By `ActorKind`; a motorcycle looks like a bicycle. Lifeless things have none.
CLASS_OF_KIND = {
    ActorKind.CAR: ObjectClass.VEHICLE,
    ActorKind.VAN: ObjectClass.VEHICLE,
    ActorKind.TRUCK: ObjectClass.VEHICLE,
    ActorKind.BUS: ObjectClass.VEHICLE,
    ActorKind.MOTORCYCLE: ObjectClass.BICYCLE,
    ActorKind.BICYCLE: ObjectClass.BICYCLE,
    ActorKind.WALKER: ObjectClass.WALKER,
}
KIND_OF_CLASS = (ActorKind.CAR, ActorKind.BICYCLE, ActorKind.WALKER)  # that rows say


@dataclass(frozen=True, kw_only=True)
class Heads:
    """What all heads say of B moments.

    Attributes:
        semantics: (B, classes, X, Y) logits of `BevClass`.
        heat: (B, 3, X, Y) logits of the middle of an object of each `ObjectClass`.
        boxes: (B, BOX, X, Y) of an object whose middle is near: offset of that from the cell's
            centre [cells], logarithms of length and width [m], sine and cosine of its heading, and
            velocity over the ground [`SPEED_MPS`].
        where: (B, X/2 * Y/2 + 1) logits of the governing stop line's middle, the last one of none.
        line: (B, 4, X/2, Y/2) of a line whose middle is near: offset [cells of that map], sine and
            cosine of its heading.
        state: (B, 4) logits of red, yellow, green and stop sign.
        lamps: (B, 4, h, w) logits of what governs, lit lamps and stop signs, in the camera that
            sees them best; None without cameras.
    """

    semantics: Tensor
    heat: Tensor
    boxes: Tensor
    where: Tensor
    line: Tensor
    state: Tensor
    lamps: Tensor | None


class ObjectHead(nn.Module):
    """Heatmaps of objects, and their boxes."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.mix = conv_block(width, width)
        self.heat = nn.Conv2d(width, len(ObjectClass), 1)
        self.boxes = nn.Conv2d(width, BOX, 1)
        nn.init.constant_(self.heat.bias, _RARE)  # type: ignore[arg-type]

    def forward(self, bev: Tensor) -> tuple[Tensor, Tensor]:
        mixed = self.mix(bev)
        return self.heat(mixed), self.boxes(mixed)


class LampHead(nn.Module):
    """Lit lamps and stop signs in an image."""

    def __init__(self, fine: int, deep: int, width: int = 16) -> None:
        super().__init__()
        self.fine, self.deep = nn.Conv2d(fine, width, 1), nn.Conv2d(deep, width, 1)
        self.mix = conv_block(width, width)
        self.lamps = nn.Conv2d(width, STATES, 1)
        self.tap = Tap()
        nn.init.constant_(self.lamps.bias, _RARE)  # type: ignore[arg-type]

    def forward(self, fine: Tensor, deep: Tensor) -> Tensor:
        """Features (B, C, H, W) and, of the same image, (B, C', h, w) to (B, 4, H, W)."""
        deep = F.interpolate(self.deep(deep), fine.shape[-2:], mode="nearest")
        return self.tap(self.lamps(self.mix(F.relu(self.fine(fine) + deep))))


class SignalHead(nn.Module):
    """The stop line that governs the ego's lane, and what its signal shows."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.mix = conv_block(width, width, stride=2)
        self.where = nn.Conv2d(width, 1, 1)
        self.line = nn.Conv2d(width, 4, 1)
        self.none = mlp(width + STATES, width)
        self.none_logit = nn.Linear(width, 1)
        self.state = mlp(width + STATES, width)
        self.state_logits = nn.Linear(width, STATES)
        self.place = Tap()

    def forward(self, bev: Tensor, lamps: Tensor | None) -> tuple[Tensor, Tensor, Tensor]:
        """(B, C, X, Y) features, (B, 4, h, w) lamps to `where`, `line` and `state` of `Heads`."""
        mixed = self.mix(bev)
        if lamps is None:
            lit = mixed.new_zeros(len(mixed), STATES)
        else:
            lit = lamps.amax(dim=(2, 3))
        logits = self.where(mixed).flatten(1)  # (B, X/2 * Y/2)
        all_round = torch.cat([mixed.mean(dim=(2, 3)), lit], dim=1)
        none = self.none_logit(F.relu(self.none(all_round)))
        where = torch.cat([logits, none], dim=1)
        share = self.place(where.softmax(dim=1))[:, :-1]
        there = share / share.sum(dim=1, keepdim=True).clamp(min=1e-6)
        at = (mixed.flatten(2) @ there[:, :, None])[:, :, 0]  # (B, C)
        # what the brightest lamps say, and what the place adds to it
        state = lit + self.state_logits(F.relu(self.state(torch.cat([at, lit], dim=1))))
        return where, self.line(mixed), state


class PerceptionHeads(nn.Module):
    """All heads of the BEV features.

    Args:
        width: Channels of these.
        lamps: Channels of the features of lamps, fine and deep; None without cameras.
    """

    def __init__(self, width: int, lamps: tuple[int, int] | None) -> None:
        super().__init__()
        self.semantics = nn.Conv2d(width, len(BevClass), 1)
        self.objects = ObjectHead(width)
        self.lamps = LampHead(*lamps) if lamps else None
        self.signal = SignalHead(width)

    def forward(self, bev: Tensor, lamps: tuple[Tensor, Tensor] | None) -> Heads:
        """(B, C, X, Y) features, and those of lamps where there are cameras, to all heads."""
        heat, boxes = self.objects(bev)
        lit = self.lamps(*lamps) if self.lamps is not None and lamps is not None else None
        where, line, state = self.signal(bev, lit)
        return Heads(
            semantics=self.semantics(bev),
            heat=heat,
            boxes=boxes,
            where=where,
            line=line,
            state=state,
            lamps=lit,
        )
