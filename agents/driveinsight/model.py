"""The whole policy, wired as in the paper's figure: perception, tokens, planner.

    cameras, LiDAR, MemoryBank -> Perception -> BevTokens --+
                                                            +-> Planner
    prompt ------------------> PromptEncoder ---------------+

`forward` is a pure function of its inputs: what is hidden in training comes in as `present`, and
what is remembered comes in and goes out as a `MemoryBank`. Who hands in rows that are `seen` needs
no sensors: so the planner learns at hundreds of samples a second.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from agents.driveinsight.bev_tokens import BevTokens
from agents.driveinsight.config import TOKENS, PolicyConfig
from agents.driveinsight.heads import Heads
from agents.driveinsight.memory import MemoryBank
from agents.driveinsight.perception import Encoded, Perception
from agents.driveinsight.planner import Planner
from agents.driveinsight.reading import read_seen
from agents.driveinsight.seen import Seen
from agents.driveinsight.tokens import PromptEncoder, told_route
from agents.networks.taps import Tap
from di_envs.prompt import COMPONENTS


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """What a policy sees at one moment, B samples at once.

    Attributes:
        prompt: The components by name, (B, ...) as in the observation.
        present: (B, 10) 0 or 1 in the order of `TOKENS`: what is given.
        images: For each size of image (B, N, 3, H, W) RGB, 0..255, see `camera.image_groups`;
            empty without cameras.
        points: (B, P, 4); None without LiDAR.
        pose: (B, 3) odometry; None without a memory.
        seen: Rows to plan by instead of those that the policy's own eyes would see; None to look.
    """

    prompt: Mapping[str, Tensor]
    present: Tensor
    images: tuple[Tensor, ...] = ()
    points: Tensor | None = None
    pose: Tensor | None = None
    seen: Seen | None = None


@dataclass(frozen=True, kw_only=True)
class Output:
    """What a policy says.

    Attributes:
        waypoints: (B, T, 2) x ahead, y right [m].
        bev: (B, C, X, Y) fused features; None without sensors.
        encoded: What the sensors show, with what is to be remembered; None without sensors.
        heads: What the features say; None without sensors.
        seen: Rows that were read off the heads; None without sensors.
    """

    waypoints: Tensor
    bev: Tensor | None = None
    encoded: Encoded | None = None
    heads: Heads | None = None
    seen: Seen | None = None

    @property
    def remembered(self) -> Tensor | None:
        """(B, C, X, Y) what is to be remembered of this moment; None without a memory."""
        return None if self.encoded is None else self.encoded.remembered


class Policy(nn.Module):
    """The network of a `PolicyConfig`."""

    def __init__(self, config: PolicyConfig) -> None:
        super().__init__()
        self.config = config
        self.perception = Perception(config) if config.sensors else None
        self.bev = (
            BevTokens(config.bev_width, config.grid, config.planner) if config.sensors else None
        )
        self.prompt = PromptEncoder(config.planner)
        self.planner = Planner(config.planner)
        self.waypoints = Tap()
        given = torch.tensor([float(name in config.prompt) for name in COMPONENTS])
        self.register_buffer("given", torch.cat([given, torch.ones(1)]), persistent=False)
        # in which CPUs and GPUs convolve faster; torch's stubs do not know the argument
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    given: Tensor

    def forward(self, inputs: Inputs, bank: MemoryBank | None = None) -> Output:
        """Plans.

        Args:
            inputs: What is seen.
            bank: What is remembered; None is an empty bank.
        """
        present = inputs.present * self.given
        if self.bev is None or self.perception is None:
            return Output(waypoints=self.plan(inputs.prompt, present, None, None))
        if inputs.seen is not None:
            return Output(waypoints=self.plan(inputs.prompt, present, inputs.seen, None))
        encoded = self.perception.encode(inputs.images, inputs.points)
        bev = self.perception.fuse(encoded, inputs.pose, bank)
        heads = self.perception.say(bev, encoded)
        seen = read_seen(heads, self.config.grid)
        return Output(
            waypoints=self.plan(inputs.prompt, present, seen, bev),
            bev=bev,
            encoded=encoded,
            heads=heads,
            seen=seen,
        )

    def plan(
        self, prompt: Mapping[str, Tensor], present: Tensor, seen: Seen | None, bev: Tensor | None
    ) -> Tensor:
        """Waypoints from what is told and what is seen.

        Args:
            prompt: The components by name.
            present: (B, 10) 0 or 1 in the order of `TOKENS`.
            seen: Rows that are seen; None for a policy without sensors.
            bev: (B, C, X, Y) features; None where there are rows alone.

        Returns:
            (B, T, 2) x ahead, y right [m].
        """
        tokens = self.prompt(prompt, present[:, : len(COMPONENTS)])
        if self.bev is not None and seen is not None:
            route = told_route(prompt, present)
            there = present[:, TOKENS.index("bev")]
            tokens.append(self.bev(seen, bev, route, there, self.prompt))
        waypoints: Tensor = self.waypoints(self.planner(tokens))
        return waypoints
