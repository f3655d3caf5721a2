"""The whole policy, wired as in the paper's figure: encoders, fusion, memory, planner.

    cameras -> CameraEncoder --+
                               +-> MultiModalFusion -> TemporalFusion -> BevTokens --+
    LiDAR ---> LidarEncoder ---+                            ^                        +-> Planner
                                                       MemoryBank                    |
    prompt -> PromptEncoder ---------------------------------------------------------+

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
from agents.driveinsight.camera import CameraEncoder
from agents.driveinsight.config import TOKENS, PolicyConfig
from agents.driveinsight.fusion import MultiModalFusion
from agents.driveinsight.lidar import LidarEncoder
from agents.driveinsight.memory import MemoryBank, TemporalFusion, empty_bank
from agents.driveinsight.planner import Planner
from agents.driveinsight.seen import Seen
from agents.driveinsight.semantics import BevClass
from agents.driveinsight.tokens import PromptEncoder, told_route
from agents.networks.taps import Tap
from di_envs.prompt import COMPONENTS


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """What a policy sees at one moment, B samples at once.

    Attributes:
        prompt: The components by name, (B, ...) as in the observation.
        present: (B, 10) 0 or 1 in the order of `TOKENS`: what is given.
        images: (B, N, 3, H, W) RGB, 0..255; None without cameras.
        points: (B, P, 4); None without LiDAR.
        pose: (B, 3) odometry; None without a memory.
        seen: Rows to plan by instead of those that the policy's own eyes would see; None to look.
    """

    prompt: Mapping[str, Tensor]
    present: Tensor
    images: Tensor | None = None
    points: Tensor | None = None
    pose: Tensor | None = None
    seen: Seen | None = None


@dataclass(frozen=True, kw_only=True)
class Output:
    """What a policy says.

    Attributes:
        waypoints: (B, T, 2) x ahead, y right [m].
        bev: (B, C, X, Y) fused features, to be remembered; None without sensors.
        semantics: (B, classes, X, Y) logits of `BevClass`; None without sensors.
        depth: (B, N, D, h, w) logits; None without cameras.
    """

    waypoints: Tensor
    bev: Tensor | None = None
    semantics: Tensor | None = None
    depth: Tensor | None = None


class Policy(nn.Module):
    """The network of a `PolicyConfig`."""

    def __init__(self, config: PolicyConfig) -> None:
        super().__init__()
        self.config = config
        width = config.bev_width
        self.camera = CameraEncoder(config.camera, config.grid) if config.camera else None
        self.lidar = LidarEncoder(config.lidar, config.grid) if config.lidar else None
        channels = [part.channels for part in (config.camera, config.lidar) if part is not None]
        self.fusion = MultiModalFusion(channels, width) if channels else None
        self.memory = (
            TemporalFusion(width, config.memory_frames, config.grid)
            if channels and config.memory_frames
            else None
        )
        self.semantics = nn.Conv2d(width, len(BevClass), 1) if channels else None
        self.bev = BevTokens(width, config.grid, config.planner) if channels else None
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
        if self.bev is None or self.semantics is None:
            return Output(waypoints=self.plan(inputs.prompt, present, None, None))
        if inputs.seen is not None:
            return Output(waypoints=self.plan(inputs.prompt, present, inputs.seen, None))
        bev, depth = self.see(inputs, bank)
        seen = Seen.nothing(len(bev), device=bev.device)
        return Output(
            waypoints=self.plan(inputs.prompt, present, seen, bev),
            bev=bev,
            semantics=self.semantics(bev),
            depth=depth,
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

    def see(self, inputs: Inputs, bank: MemoryBank | None) -> tuple[Tensor, Tensor | None]:
        """Fused BEV features, and the depth logits where there are cameras."""
        maps, depth = [], None
        if self.camera is not None:
            assert inputs.images is not None, "this policy has cameras: give images"
            features, depth = self.camera(inputs.images)
            maps.append(features)
        if self.lidar is not None:
            assert inputs.points is not None, "this policy has a LiDAR: give points"
            maps.append(self.lidar(inputs.points))
        assert self.fusion is not None
        bev = self.fusion(maps)
        if self.memory is None:
            return bev, depth
        assert inputs.pose is not None, "this policy has a memory: give pose"
        bank = bank or self.empty_bank(len(bev), like=bev)
        return self.memory(bev, inputs.pose, bank), depth

    def empty_bank(self, batch: int, *, like: Tensor) -> MemoryBank:
        """A memory bank for this policy that remembers nothing."""
        config = self.config
        return empty_bank(
            batch, config.memory_frames, config.bev_width, config.grid.cells, like=like
        )
