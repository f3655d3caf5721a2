"""CARLA's plain values: places, rotations, controls, and the names of what lanes and lights are.

Where the `carla` wheel is installed they are its own. Where it is not, an agent is given these in
its place, with the same fields: metres in the world frame, degrees. They are no simulator.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np


def _single(value: float) -> float:
    """As CARLA keeps it, so that an agent sees the same number with the wheel and without."""
    return float(np.float32(value))


@dataclass
class Vector3D:
    """Three numbers."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def __post_init__(self) -> None:
        self.x, self.y, self.z = _single(self.x), _single(self.y), _single(self.z)

    def __add__(self, other: Vector3D) -> Any:
        return type(self)(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vector3D) -> Any:
        return type(self)(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, factor: float) -> Any:
        return type(self)(self.x * factor, self.y * factor, self.z * factor)

    __rmul__ = __mul__

    def dot(self, other: Vector3D) -> float:
        """The scalar product."""
        return self.x * other.x + self.y * other.y + self.z * other.z

    def length(self) -> float:
        """Of the vector."""
        return math.sqrt(self.dot(self))


@dataclass
class Location(Vector3D):
    """A place in the world frame [m]."""

    def distance(self, location: Vector3D) -> float:
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

    def get_forward_vector(self) -> Vector3D:
        """(1, 0, 0), turned; the roll does not matter."""
        yaw, pitch = math.radians(self.yaw), math.radians(self.pitch)
        return Vector3D(
            math.cos(pitch) * math.cos(yaw), math.cos(pitch) * math.sin(yaw), math.sin(pitch)
        )

    def get_right_vector(self) -> Vector3D:
        """(0, 1, 0), turned by the yaw: of a level frame."""
        yaw = math.radians(self.yaw)
        return Vector3D(-math.sin(yaw), math.cos(yaw), 0.0)


@dataclass
class Transform:
    """A place and a rotation."""

    location: Location = field(default_factory=Location)
    rotation: Rotation = field(default_factory=Rotation)

    def get_forward_vector(self) -> Vector3D:
        """The way ahead."""
        return self.rotation.get_forward_vector()

    def get_right_vector(self) -> Vector3D:
        """The way to the right."""
        return self.rotation.get_right_vector()


@dataclass
class BoundingBox:
    """A box: its middle in the actor's frame, and its half sides [m]."""

    location: Location = field(default_factory=Location)
    extent: Vector3D = field(default_factory=Vector3D)


@dataclass
class VehicleControl:
    """What a driver does."""

    throttle: float = 0.0
    steer: float = 0.0
    brake: float = 0.0
    hand_brake: bool = False
    reverse: bool = False
    manual_gear_shift: bool = False
    gear: int = 0


@dataclass
class GeoLocation:
    """A place on Earth [deg, m]."""

    latitude: float = 0.0
    longitude: float = 0.0
    altitude: float = 0.0


class TrafficLightState(Enum):
    """What a light shows."""

    Red = 0
    Yellow = 1
    Green = 2
    Off = 3
    Unknown = 4


class LaneType(IntEnum):
    """What a lane is for: those that are told apart here; a bit each."""

    NONE = 1
    Driving = 2
    Shoulder = 8
    Biking = 16
    Sidewalk = 32
    Parking = 256
    Any = -2


class LaneChange(IntEnum):
    """To which sides one may change."""

    NONE = 0
    Right = 1
    Left = 2
    Both = 3


_VALUES = (
    Vector3D,
    Location,
    Rotation,
    Transform,
    BoundingBox,
    VehicleControl,
    GeoLocation,
    TrafficLightState,
    LaneType,
    LaneChange,
)


class _Values(ModuleType):
    """What `import carla` gives an agent where the wheel is not installed."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        known = ", ".join(value.__name__ for value in _VALUES)
        raise AttributeError(
            f"carla.{name} is not here: CARLA's wheel is not installed (pip install "
            f"'driveinsight[carla]'), and no simulator runs in any case. There is: {known}."
        )


@cache
def _ours() -> ModuleType:
    module = _Values("carla")
    for value in _VALUES:
        setattr(module, value.__name__, value)
    return module


def carla_values() -> Any:
    """The wheel where it is installed, else a module of the classes above."""
    try:
        import carla

        return carla if hasattr(carla, "Transform") else _ours()
    except ImportError:  # a folder called `carla` is not the wheel either
        return _ours()
