"""Hashes of all that an agent saw, earned, caused and was: two episodes are equal if these are."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.world.state import State
from di_envs.world.world import Event

_EVENT = struct.Struct("<4q4d")
_REWARD = struct.Struct("<d")
_EGO = ("throttle", "steer", "brake", "x", "y", "z", "yaw", "speed")
_CHECK_BYTES = 4


class EpisodeHash:
    """Running BLAKE2b digests of 128 bits, fed step by step, and a short one a look."""

    def __init__(self) -> None:
        self._observations = hashlib.blake2b(digest_size=16)
        self._rewards = hashlib.blake2b(digest_size=16)
        self._events = hashlib.blake2b(digest_size=16)
        self._states = hashlib.blake2b(digest_size=16)
        self._checks = bytearray()

    def add_observation(self, observation: Mapping[str, Any]) -> None:
        """Adds every array, in the dict's order, bytes only: spaces fix the shapes."""
        digest = observation_digest(observation)
        self._observations.update(digest)
        self._checks += digest[:_CHECK_BYTES]

    def add_reward(self, reward: float) -> None:
        self._rewards.update(_REWARD.pack(reward))

    def add_events(self, events: Iterable[Event]) -> None:
        for e in events:
            self._events.update(_EVENT.pack(e.kind, e.ego, e.tick, e.other, e.x, e.y, e.z, e.value))

    def add_state(self, state: State, ego: int) -> None:
        """Adds the controls that an ego holds, where it is and how fast."""
        self._states.update(b"".join([getattr(state, name)[ego].tobytes() for name in _EGO]))

    def state_hex(self, state: State) -> str:
        """The digest of the states so far, closed with the whole of `state`."""
        closed = self._states.copy()
        for array in state:
            closed.update(_bytes_of(array))
        return closed.hexdigest()

    def hex(self) -> tuple[str, str, str]:
        """The digests so far of observations, rewards and events."""
        return (
            self._observations.hexdigest(),
            self._rewards.hexdigest(),
            self._events.hexdigest(),
        )

    def checks(self) -> NDArray[np.uint32]:
        """(N,) one short hash for each observation so far; see `observation_check`."""
        return np.frombuffer(bytes(self._checks), "<u4")


def observation_digest(observation: Mapping[str, Any]) -> bytes:
    """16 bytes of BLAKE2b over every array of an observation, in its order."""
    parts = b"".join([_bytes_of(array) for array in observation.values()])
    return hashlib.blake2b(parts, digest_size=16).digest()


def observation_check(observation: Mapping[str, Any]) -> int:
    """32 bits that tell one observation from another: what a record keeps of each."""
    return int.from_bytes(observation_digest(observation)[:_CHECK_BYTES], "little")


def _bytes_of(value: Any) -> Any:
    """The value itself where it is a contiguous array, which needs no copy here."""
    if isinstance(value, np.ndarray) and value.flags.c_contiguous:
        return value
    return np.ascontiguousarray(value)
