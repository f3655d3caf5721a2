"""CARLA's places and rotations, as an agent for its Leaderboard is handed them with its route.

Where the `carla` wheel is installed they are its own. Where it is not, an agent that does not
import it still gets values with the same fields: metres in the world frame, degrees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np


def _single(value: float) -> float:
    """As CARLA keeps it, so that an agent sees the same number with the wheel and without."""
    return float(np.float32(value))


@dataclass
class Location:
    """A place in the world frame [m]."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def __post_init__(self) -> None:
        self.x, self.y, self.z = _single(self.x), _single(self.y), _single(self.z)

    def distance(self, location: Location) -> float:
        """Metres to another place."""
        return math.dist((self.x, self.y, self.z), (location.x, location.y, location.z))


@dataclass
class Rotation:
    """Angles [deg]; yaw clockwise from x towards y, seen from above."""

    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0

    def __post_init__(self) -> None:
        self.pitch, self.yaw = _single(self.pitch), _single(self.yaw)
        self.roll = _single(self.roll)


@dataclass
class Transform:
    """A place and a rotation."""

    location: Location = field(default_factory=Location)
    rotation: Rotation = field(default_factory=Rotation)


class CarlaValues(NamedTuple):
    """The three classes, ours or the wheel's."""

    Location: Any
    Rotation: Any
    Transform: Any


def carla_values() -> CarlaValues:
    """The wheel's classes where it is installed, else those above."""
    try:
        import carla

        return CarlaValues(carla.Location, carla.Rotation, carla.Transform)
    except (ImportError, AttributeError):  # a folder called `carla` is not the wheel
        return CarlaValues(Location, Rotation, Transform)
