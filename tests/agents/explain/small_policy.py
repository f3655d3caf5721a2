"""A DriveInsight policy of a few thousand weights, and a moment of a drive with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

import di_envs
from agents import load_agent
from agents.driveinsight.config import (
    CameraEncoderConfig,
    FusionConfig,
    PlannerConfig,
    PolicyConfig,
)
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import save_pretrained
from agents.networks.grid import GridConfig
from tests.agents.driveinsight.random_inputs import awake

CONFIG = PolicyConfig(
    name="test",
    grid=GridConfig(cells=24),
    camera=CameraEncoderConfig(rig="rl", width=4, stride=4, channels=4, depth_bins=4),
    lidar=None,
    planner=PlannerConfig(width=16, heads=2, layers=3),
    memory_frames=2,
    fusion=FusionConfig(width=4, remembered=4, widths=(4, 4)),
)


def save_policy(folder: Path, seed: int = 3, config: PolicyConfig = CONFIG) -> Path:
    """Writes an untrained policy."""
    torch.manual_seed(seed)
    save_pretrained(awake(Policy(config)), folder, "a card")
    return folder


def agent_of(folder: Path) -> Any:
    """The agent that drives with it."""
    return load_agent(f"driveinsight:{folder}")


def moment_of(agent: Any, steps: int = 12) -> tuple[Any, Any]:
    """Observation and memory after some decisions on a toy route."""
    needs = agent.requires
    env = di_envs.RouteEnv(suite="toy", observations=needs.observations, **needs.options)
    observation, _ = env.reset(seed=1)
    memory = agent.start(env.plan, 1)
    for _ in range(steps):
        control, memory = agent.act(observation, memory)
        observation, *_ = env.step(control)
    env.close()
    return observation, memory
