"""Keyed randomness: each draw is a hash of what it is for, so no draw depends on another.

Removing an actor, adding a sensor or skipping a draw then changes nobody else's numbers.
Source: the mixing steps are SplitMix64's (Steele, Lea, Flood: Fast Splittable Pseudorandom Number
Generators, OOPSLA 2014), folded over the four keys.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any

import numpy as np

from di_envs.numerics.kernels import kernel

Bits = np.uint64
Key = Any  # a whole number of any width, taken modulo 2**64


class Stream(IntEnum):
    """What a draw is for. Numbers are never reused or reordered: they are part of every seed."""

    TRAFFIC_SPAWN = 1
    TRAFFIC_DRIVER = 2
    TRAFFIC_TURN = 3
    WALKER_SPAWN = 4
    WALKER_PACE = 5
    WALKER_TURN = 6
    LIGHT_PHASE = 7
    IMU = 8
    GNSS = 9
    AGENT = 10
    WEATHER = 11
    ROUTE = 12
    VEHICLE_COLOUR = 13
    SCENERY = 14  # of a town, the same in every episode
    RAIN = 15
    LIDAR = 16  # which rays are dropped
    LIDAR_NOISE = 17
    SCENARIO = 18  # what a trigger brings: keyed by its number in its ego's plan, and the ego
    STEER_NOISE = 19
    THROTTLE_NOISE = 20
    TRAFFIC_RETURN = 21  # where a vehicle that has left by an open end comes back
    RADAR = 22  # where in its cone each ray of a radar goes


@kernel
def mix(value: Key) -> Bits:
    """Scrambles 64 bits."""
    value = np.uint64(value) + np.uint64(0x9E3779B97F4A7C15)
    value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))


@kernel
def keyed_part(seed: Key, stream: Key, tick: Key) -> Bits:
    """What many draws share: `keyed_hash(seed, stream, tick, actor)` is `mix(part ^ actor)`."""
    value = mix(np.uint64(seed))
    value = mix(value ^ np.uint64(stream))
    return mix(value ^ np.uint64(tick))


@kernel
def keyed_hash(seed: Key, stream: Key, tick: Key, actor: Key) -> Bits:
    """Hashes four integers to 64 bits."""
    return mix(keyed_part(seed, stream, tick) ^ np.uint64(actor))


@kernel
def uniform(seed: Key, stream: Key, tick: Key, actor: Key) -> float:
    """A number in [0, 1), a function of its four integer keys alone."""
    return float(keyed_hash(seed, stream, tick, actor) >> np.uint64(11)) * (
        1.0 / 9007199254740992.0
    )


@kernel
def normal(seed: Key, stream: Key, tick: Key, actor: Key) -> float:
    """A standard normal number (Box-Muller), a function of its four integer keys alone."""
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(seed, stream, tick, actor)))
    return radius * math.cos(2.0 * math.pi * uniform(seed, stream + 1000, tick, actor))
