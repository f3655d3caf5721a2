"""The whole policy, wired as in the paper's figure: perception, tokens, planner.

    cameras, LiDAR, MemoryBank -> Perception -> BevTokens --+
                                                            +-> Planner
    prompt ------------------> PromptEncoder ---------------+

`forward` is a pure function of its inputs: what is hidden in training comes in as `present`, and
what is remembered comes in and goes out as a `MemoryBank`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from agents.driveinsight.config import TOKENS, PolicyConfig
from agents.driveinsight.heads import Heads
from agents.driveinsight.memory import MemoryBank
from agents.driveinsight.perception import Encoded, Perception
from agents.driveinsight.planner import BevTokens, Planner
from agents.driveinsight.tokens import PromptEncoder
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
    """

    prompt: Mapping[str, Tensor]
    present: Tensor
    images: tuple[Tensor, ...] = ()
    points: Tensor | None = None
    pose: Tensor | None = None


@dataclass(frozen=True, kw_only=True)
class Output:
    """What a policy says.

    Attributes:
        waypoints: (B, T, 2) x ahead, y right [m].
        bev: (B, C, X, Y) fused features; None without sensors.
        encoded: What the sensors show, with what is to be remembered; None without sensors.
        heads: What the features say; None without sensors.
    """

    waypoints: Tensor
    bev: Tensor | None = None
    encoded: Encoded | None = None
    heads: Heads | None = None

    @property
    def remembered(self) -> Tensor | None:
        """(B, C, X, Y) what is to be remembered of this moment; None without a memory."""
        return None if self.encoded is None else self.encoded.remembered


class Policy(nn.Module):
    """The network of a `PolicyConfig`."""

    def __init__(self, config: PolicyConfig) -> None:
        super().__init__()
        self.config = config
        width, cells = config.bev_width, config.grid.cells
        self.perception = Perception(config) if config.sensors else None
        self.bev = BevTokens(width, cells, config.planner) if config.sensors else None
        self.prompt = PromptEncoder(config.planner.width)
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
        tokens = self.prompt(inputs.prompt, present[:, : len(COMPONENTS)])
        if self.bev is None or self.perception is None:
            return Output(waypoints=self.waypoints(self.planner(tokens, None, None)))
        encoded = self.perception.encode(inputs.images, inputs.points)
        bev = self.perception.fuse(encoded, inputs.pose, bank)
        patches = self.bev(bev, present[:, TOKENS.index("bev")])
        return Output(
            waypoints=self.waypoints(self.planner(tokens, patches, self.bev.place)),
            bev=bev,
            encoded=encoded,
            heads=self.perception.say(bev, encoded),
        )
