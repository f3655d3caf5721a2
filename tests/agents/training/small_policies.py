"""Policies small enough to be trained within a test."""

from __future__ import annotations

from torch import Tensor

from agents.driveinsight.config import (
    CameraEncoderConfig,
    FusionConfig,
    LidarEncoderConfig,
    PlannerConfig,
    PolicyConfig,
)
from agents.networks.grid import GridConfig

_PLANNER = PlannerConfig(width=16, heads=2, layers=1)

PROMPT_ONLY = PolicyConfig(
    name="test-prompt-only",
    camera=None,
    lidar=None,
    memory_frames=0,
    planner=PlannerConfig(width=32, heads=2, layers=1),
)
SEEING = PolicyConfig(
    name="test-seeing",
    grid=GridConfig(cells=24),
    camera=CameraEncoderConfig(rig="rl", width=4, stride=8, channels=4, depth_bins=4),
    lidar=LidarEncoderConfig(channels=4),
    planner=_PLANNER,
    memory_frames=2,
    fusion=FusionConfig(width=4, remembered=4, widths=(4, 4)),
)


def on_disk(value: Tensor) -> Tensor:
    """A weight as it comes back from where it was saved: float16 has rounded it."""
    return value.half().to(value.dtype) if value.is_floating_point() else value
