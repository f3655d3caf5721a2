"""A policy that is lent perfect eyes: what truly is in sight stands in for what it would see.

How well a policy plans with that says what is left to gain by seeing better. It is told the truth
of the world, so it is on the track PRIVILEGED.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import torch

from agents.base import Observation
from agents.driveinsight.agent import DriveInsightAgent, requirements_of
from agents.driveinsight.inputs import inputs_of
from agents.driveinsight.model import Inputs
from agents.driveinsight.seen import Seen
from agents.training.caching import truly_seen


class TrueSightAgent(DriveInsightAgent):
    """Drives with a trained policy whose eyes are the simulator.

    Args:
        weights: Folder of a policy with sensors, which are not used.
    """

    def __init__(self, *, weights: str | Path) -> None:
        super().__init__(weights=weights)
        needs = requirements_of(self.policy.config)
        self.requires = dataclasses.replace(
            needs, observations=("prompt",), options={}, privileged=True
        )

    def _inputs(self, observation: Observation) -> Inputs:
        config = self.policy.config
        blind = dataclasses.replace(config, camera=None, lidar=None, memory_frames=0)
        objects, signals = truly_seen(observation["world"], config.grid)
        seen = Seen(
            objects=torch.from_numpy(objects)[None], signals=torch.from_numpy(signals)[None]
        )
        return dataclasses.replace(inputs_of(blind, observation), seen=seen)
