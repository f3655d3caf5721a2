"""A model of the world: a state that goes on by itself, and is put right by what is seen.

    cameras -> ground + route, speed -> what is seen --+
                                                       v
    state (h, z), action -> GRU -> h -> prior of z, posterior of z -> z
                                   (h, z) -> action and waypoints; the ground, decoded

Where nothing is seen z is drawn from the prior: that is imagining.
Source: Hu et al., Model-Based Imitation Learning for Urban Driving (MILE), NeurIPS 2022. What we
changed: sizes; moments 0.5 s apart; the action that the state goes on by is its own; waypoints
beside the action, which say where it leads.
"""

from __future__ import annotations

from itertools import pairwise

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.driveinsight.semantics import BevClass
from agents.explain.protocol import Anatomy, TokenGroup
from agents.networks.blocks import conv_block
from agents.networks.initial import begin_as_he
from agents.networks.mlp import mlp
from agents.networks.taps import Tap
from agents.networks.waypoint_heads import StepsHead
from agents.zoo.errors import action_error, waypoint_error
from agents.zoo.eyes import BEV, CHANNELS, BevEyes
from agents.zoo.mile.config import MileConfig
from agents.zoo.system import Labels, Output, Seen, State, SystemModel
from agents.zoo.told import ToldEncoder

SEMANTICS, KL, BALANCE = 0.1, 1e-3, 0.75  # as published
HARDEST = 0.25  # share of the cells that semantics are learnt from
_SIDE, _COARSE, _FINE = 6, 16, 32  # of the map that decoding begins with; channels
_TURN_RAD = 0.3  # up to which a spoilt route is turned


class Observing(nn.Module):
    """What a moment shows, with route and speed, to a vector."""

    def __init__(self, config: MileConfig) -> None:
        super().__init__()
        self.eyes = BevEyes(config)
        self.told = ToldEncoder(config.told, config.token)
        self.down = nn.Sequential(
            conv_block(CHANNELS + len(config.told) * config.token, 48, stride=2),
            conv_block(48, 64, stride=2),
            conv_block(64, 24, stride=2),
        )
        side = BEV.cells // 8
        self.join = nn.Sequential(nn.Linear(24 * side * side, config.seen), nn.ReLU())

    def forward(self, seen: Seen) -> Tensor:
        """(B, seen)."""
        bev, _ = self.eyes(seen)
        told = self.told(seen).flatten(1)[:, :, None, None].expand(-1, -1, *bev.shape[2:])
        vector: Tensor = self.join(self.down(torch.cat([bev, told], dim=1)).flatten(1))
        return vector


class Decoder(nn.Module):
    """A state to the ground that it stands for."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.enter = nn.Linear(width, _COARSE * _SIDE * _SIDE)
        widths = (_COARSE, _FINE, _FINE, _FINE)
        self.up = nn.ModuleList(conv_block(*pair) for pair in pairwise(widths))
        self.out = nn.Conv2d(_FINE, len(BevClass), 1)

    def forward(self, state: Tensor) -> Tensor:
        """(B, width) to (B, BevClass, 96, 96) logits."""
        x = self.enter(state).unflatten(1, (_COARSE, _SIDE, _SIDE))
        for conv in self.up:
            x = conv(F.interpolate(x, scale_factor=2.0, mode="nearest"))
        logits: Tensor = F.interpolate(
            self.out(x), scale_factor=2.0, mode="bilinear", align_corners=False
        )
        return logits


class Mile(SystemModel):
    """The network."""

    def __init__(self, config: MileConfig) -> None:
        super().__init__()
        self.config: MileConfig = config
        memory, latent, width = config.memory, config.latent, config.width
        self.observe = Observing(config)
        self.cell = nn.GRUCell(latent + 2, memory)
        self.prior = nn.Sequential(mlp(memory, width), nn.ReLU(), nn.Linear(width, 2 * latent))
        self.posterior = nn.Sequential(
            mlp(memory + config.seen, width), nn.ReLU(), nn.Linear(width, 2 * latent)
        )
        self.memory = Tap()
        self.policy = nn.Sequential(mlp(memory + latent, width), nn.ReLU())
        self.action = nn.Sequential(nn.Linear(width, 2), nn.Tanh())
        self.plan = StepsHead(width, config.waypoints)
        self.decode = Decoder(memory + latent)
        # the way from route to plan is ten layers long
        for part in (self.observe, self.prior, self.posterior, self.policy, self.plan.steps[0]):
            begin_as_he(part)

    def forward(self, seen: Seen, state: State | None = None) -> Output:
        if state is None:
            state = self._nothing(seen)
        h, z, action = state
        h = self.memory(self.cell(torch.cat([z, action], dim=1), h))
        prior = self.prior(h)
        if self.config.cameras[0] in seen:
            posterior = self.posterior(torch.cat([h, self.observe(self._spoilt(seen))], dim=1))
            z = self._drawn(prior, posterior)
        else:
            posterior, z = prior, self._drawn(prior, prior)
        both = torch.cat([h, z], dim=1)
        policy = self.policy(both)
        action = self.action(policy)
        said = {"prior": prior, "posterior": posterior}
        if self.training:
            said["semantics"] = self.decode(both)
        return Output(
            waypoints=self.plan(policy),
            action=action,
            said=said,
            state=(h, z, action.detach()),
        )

    def imagined(self, state: State) -> tuple[Tensor, Output]:
        """What it believes to be around it, and what it says a moment later if it sees nothing.

        Args:
            state: What a moment had it remember.

        Returns:
            (B, BevClass, X, Y) logits on the grid of the zoo's views from above; and the output.
        """
        ground: Tensor = self.decode(torch.cat(state[:2], dim=1))
        return ground, self({}, state)

    def _nothing(self, seen: Seen) -> State:
        like = seen["speed"]
        sizes = (self.config.memory, self.config.latent, 2)
        h, z, action = (like.new_zeros(len(like), size) for size in sizes)
        return h, z, action

    def _drawn(self, prior: Tensor, posterior: Tensor) -> Tensor:
        """(B, latent): the mean while driving; in training drawn, now and then from the prior."""
        if not self.training:
            return _mean_and_deviation(posterior)[0]
        blind = torch.rand(len(prior), 1, device=prior.device) < self.config.blind
        mean, deviation = _mean_and_deviation(torch.where(blind, prior, posterior))
        return mean + deviation * torch.randn_like(mean)

    def _spoilt(self, seen: Seen) -> Seen:
        """What training shows: a speed that is off, and a route that is there, but for a few."""
        if not self.training:
            return seen
        noise = torch.randn_like(seen["speed"]) * self.config.speed_noise_mps
        route = _spoilt_route(seen["routing"], self.config.route_spoilt)
        return {**seen, "speed": seen["speed"] + noise, "routing": route}

    def loss(self, output: Output, labels: Labels) -> dict[str, Tensor]:
        said = output.said or {}
        terms = {
            "waypoints": waypoint_error(output, labels),
            "action": action_error(output, labels),
            "kl": KL * balanced_kl(said["posterior"].float(), said["prior"].float()),
        }
        if "semantics" in said:
            wrong = F.cross_entropy(
                said["semantics"].float(), labels["semantics"].long(), reduction="none"
            ).flatten(1)
            hardest = wrong.topk(int(HARDEST * wrong.shape[1]), dim=1).values
            terms["semantics"] = SEMANTICS * hardest.mean()
        return terms

    @property
    def anatomy(self) -> Anatomy:
        groups = self.observe.told.groups("observe.told")
        groups["memory"] = TokenGroup(tap="memory")
        return Anatomy(groups=groups, maps=self.observe.eyes.maps("observe.eyes"))


def balanced_kl(posterior: Tensor, prior: Tensor) -> Tensor:
    """How far the posterior is from the prior, of which the latter learns more.

    Source: Hafner et al., Mastering Atari with Discrete World Models, ICLR 2021.
    """
    prior_learns = _kl(posterior.detach(), prior)
    return BALANCE * prior_learns + (1.0 - BALANCE) * _kl(posterior, prior.detach())


def _kl(p: Tensor, q: Tensor) -> Tensor:
    """Of two normal distributions, (B, 2 * latent) each, summed over the latent."""
    (m, s), (n, t) = _mean_and_deviation(p), _mean_and_deviation(q)
    each = (t / s).log() + (s.square() + (m - n).square()) / (2.0 * t.square()) - 0.5
    return each.sum(dim=1).mean()


def _mean_and_deviation(both: Tensor) -> tuple[Tensor, Tensor]:
    """(B, latent) each; deviations from 0.1 to 2.1."""
    mean, raw = both.chunk(2, dim=1)
    return mean, 2.0 * (0.5 * raw).sigmoid() + 0.1


def _spoilt_route(route: Tensor, share: float) -> Tensor:
    """(B, R, 4): of a share of the samples nothing, of as many the beginning, as many turned."""
    batch, points = route.shape[:2]
    draw, amount = torch.rand(2, batch, 1, device=route.device)
    left = torch.where(draw < share, 0.0, torch.where(draw < 2.0 * share, amount, 1.0)) * points
    kept = torch.arange(points, device=route.device) < left  # (B, R)
    turned = (draw >= 2.0 * share) & (draw < 3.0 * share)
    angle = torch.where(turned, (2.0 * amount - 1.0) * _TURN_RAD, 0.0)
    cos, sin = angle.cos(), angle.sin()
    x, y, yaw, valid = route.unbind(dim=2)
    rows = torch.stack([cos * x - sin * y, sin * x + cos * y, yaw + angle, valid], dim=2)
    return rows * kept[:, :, None]
