"""Hashes of all that an agent saw, earned and caused: two episodes are equal when these are."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from di_envs.world.world import Event

_EVENT = struct.Struct("<4q4d")
_REWARD = struct.Struct("<d")


class EpisodeHash:
    """Three running BLAKE2b digests of 128 bits, fed step by step."""

    def __init__(self) -> None:
        self._observations = hashlib.blake2b(digest_size=16)
        self._rewards = hashlib.blake2b(digest_size=16)
        self._events = hashlib.blake2b(digest_size=16)

    def add_observation(self, observation: Mapping[str, Any]) -> None:
        """Adds every array, in the dict's order, bytes only: spaces fix the shapes."""
        self._observations.update(b"".join([_bytes_of(array) for array in observation.values()]))

    def add_reward(self, reward: float) -> None:
        self._rewards.update(_REWARD.pack(reward))

    def add_events(self, events: Iterable[Event]) -> None:
        for e in events:
            self._events.update(_EVENT.pack(e.kind, e.ego, e.tick, e.other, e.x, e.y, e.z, e.value))

    def hex(self) -> tuple[str, str, str]:
        """The digests so far of observations, rewards and events."""
        return (
            self._observations.hexdigest(),
            self._rewards.hexdigest(),
            self._events.hexdigest(),
        )


def _bytes_of(value: Any) -> Any:
    """The value itself where it is a contiguous array, which needs no copy here."""
    if isinstance(value, np.ndarray) and value.flags.c_contiguous:
        return value
    return np.ascontiguousarray(value)
