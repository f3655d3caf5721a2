"""A policy that is lent eyes: what truly is in sight stands in for what it would see.

How well a policy plans with perfect eyes says what is left to gain by seeing better. With blurred
ones it is corrected before it has learnt to see, without a picture being rendered. It is told the
truth of the world, so it is on the track PRIVILEGED.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import torch

from agents.base import Observation, Requirements
from agents.driveinsight.agent import (
    DriveInsightAgent,
    DriveInsightMemory,
    requirements_of,
)
from agents.driveinsight.config import PolicyConfig
from agents.driveinsight.inputs import inputs_of
from agents.driveinsight.model import Inputs
from agents.driveinsight.seen import Seen
from agents.training.caching import truly_seen
from agents.training.seen_noise import NO_NOISE, EyeConfig, seen_through
from di_envs.files.names import check_name
from di_envs.numerics.keyed_random import Stream, keyed_hash

EYES: Mapping[str, EyeConfig] = MappingProxyType({"perfect": NO_NOISE, "blurred": EyeConfig()})


class TrueSightAgent(DriveInsightAgent):
    """Drives with a trained policy whose eyes are the simulator.

    Args:
        weights: Folder of a policy with sensors, which are not used.
        eyes: `perfect`, or `blurred` as in training; see `EyeConfig`.
    """

    def __init__(self, *, weights: str | Path, eyes: str = "perfect") -> None:
        check_name(eyes, EYES, "kind of eyes")
        super().__init__(weights=weights)
        self._eyes = EYES[eyes]
        self.requires = requirements_with_lent_eyes(self.policy.config)

    def _inputs(self, observation: Observation, memory: DriveInsightMemory) -> Inputs:
        config = self.policy.config
        blind = dataclasses.replace(config, camera=None, lidar=None, memory_frames=0)
        objects, signals = (rows[None] for rows in truly_seen(observation["world"], config.grid))
        key = int(keyed_hash(memory.seed, int(Stream.AGENT), memory.decision, 7)) % 2**62
        objects, signals = seen_through(self._eyes, config.grid, objects, signals, key)
        seen = Seen(
            objects=torch.from_numpy(objects).float(), signals=torch.from_numpy(signals).float()
        )
        return dataclasses.replace(inputs_of(blind, observation), seen=seen)


def requirements_with_lent_eyes(config: PolicyConfig) -> Requirements:
    """What a policy of that configuration needs when it need not look for itself."""
    needs = requirements_of(config)
    return dataclasses.replace(needs, observations=("prompt",), options={}, privileged=True)
