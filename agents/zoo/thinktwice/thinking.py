"""One time of thinking again: what comes if it drives as planned, what is there, what to mend."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from agents.driveinsight.rows import METRES
from agents.networks.looking import features_at
from agents.networks.mlp import mlp
from agents.networks.spatial_gru import SpatialGru
from agents.networks.taps import Tap
from agents.networks.waypoint_heads import STEP_M
from agents.zoo.eyes import BEV
from agents.zoo.thinktwice.config import ThinkTwiceConfig

_STEP = 4  # numbers that a step of a plan is told by: where it leads, and the action
_AROUND_M = 4.0  # scale of how far beside a planned point it looks


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A plan.

    Attributes:
        waypoints: (B, T, 2) [m].
        action: (B, 2) throttle less brake, and steer, before they are bent into -1..1.
    """

    waypoints: Tensor
    action: Tensor


@dataclass(frozen=True, kw_only=True)
class Thought:
    """What came of thinking again.

    Attributes:
        offsets: Of waypoints and action.
        future: (B, T, C, X, Y) the ground at each waypoint's time.
    """

    offsets: Plan
    future: Tensor


class ThinkingAgain(nn.Module):
    """Predict, look, and say offsets, which begin at zero."""

    def __init__(self, config: ThinkTwiceConfig) -> None:
        super().__init__()
        self.looks, rolled, width = config.looks, config.rolled, config.width
        self.predict = SpatialGru(_STEP, rolled)
        self.where = nn.Linear(width + _STEP, 3 * config.looks)
        self.seen = Tap()
        self.mix = nn.Sequential(mlp(width + _STEP + rolled, width), nn.ReLU())
        self.mend, self.act = nn.Linear(width, 2), nn.Linear(width, 2)
        for last in (self.mend, self.act):
            nn.init.zeros_(last.weight)
            nn.init.zeros_(last.bias)

    def forward(self, plan: Plan, vector: Tensor, ground: Tensor) -> Thought:
        """Thinks.

        Args:
            plan: So far.
            vector: (B, width) what is known of the whole.
            ground: (B, C, X, Y) of now.
        """
        steps = torch.cat(
            [
                plan.waypoints / METRES,
                plan.action.tanh()[:, None].expand(-1, plan.waypoints.shape[1], -1),
            ],
            dim=2,
        )  # (B, T, _STEP)
        future = self._future(steps, ground)
        known = torch.cat([vector[:, None].expand(-1, steps.shape[1], -1), steps], dim=2)
        looked = self.seen(self._look(known, plan.waypoints, future))  # (B, T, C)
        mixed = self.mix(torch.cat([known, looked], dim=2))
        offsets = Plan(waypoints=STEP_M * self.mend(mixed), action=self.act(mixed.mean(dim=1)))
        return Thought(offsets=offsets, future=future)

    def _future(self, steps: Tensor, ground: Tensor) -> Tensor:
        """(B, T, C, X, Y): the ground is rolled forward by the plan."""
        maps = list[Tensor]()
        for step in steps.unbind(dim=1):
            told = step[:, :, None, None].expand(-1, -1, *ground.shape[2:])
            ground = self.predict(told, ground)
            maps.append(ground)
        return torch.stack(maps, dim=1)

    def _look(self, known: Tensor, waypoints: Tensor, future: Tensor) -> Tensor:
        """(B, T, C) features around each planned point at its time, weighed by attention."""
        batch, steps = known.shape[:2]
        around, weights = self.where(known).split([2 * self.looks, self.looks], dim=2)
        around = around.unflatten(2, (self.looks, 2)).tanh()
        places = waypoints[:, :, None] + _AROUND_M * around  # (B, T, K, 2)
        found = features_at(future.flatten(0, 1), places.flatten(0, 1), BEV)  # (B*T, K, C)
        share = weights.softmax(dim=2)[..., None]
        return (found.unflatten(0, (batch, steps)) * share).sum(dim=2)
