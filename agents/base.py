"""What an agent is: the contract between a driver and whatever runs it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from di_envs.town.plan import RoutePlan
from di_envs.world.world import WorldView

Observation = Mapping[str, Any]
Control = NDArray[np.float32]  # (3,) throttle 0..1, steer -1..1 (positive right), brake 0..1
Memory = TypeVar("Memory")


class Track(StrEnum):
    """What an agent may use; printed with every result."""

    PROMPT = "PROMPT"
    MAP = "MAP"
    SENSORS = "SENSORS"
    PRIVILEGED = "PRIVILEGED"


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """What an agent needs from its environment, and so its track."""

    observations: tuple[str, ...] = ("prompt",)
    control_dt_s: float = 0.1
    privileged: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)  # further environment options

    @property
    def track(self) -> Track:
        if self.privileged:
            return Track.PRIVILEGED
        if {"camera", "lidar"} & set(self.observations):
            return Track.SENSORS
        return Track.PROMPT


class Agent(Protocol[Memory]):
    """Chooses controls from what it `requires`, and from nothing else.

    All memory is a value, passed in and out, so that an episode can be branched with its agent.
    A privileged agent's observation holds a read-only `WorldView` under the key `world`.
    """

    requires: Requirements

    def start(self, plan: RoutePlan, seed: int) -> Memory: ...

    def act(self, observation: Observation, memory: Memory) -> tuple[Control, Memory]: ...

    def close(self) -> None: ...


__all__ = ["Agent", "Control", "Memory", "Observation", "Requirements", "Track", "WorldView"]
