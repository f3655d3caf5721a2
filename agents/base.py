"""What an agent is: the contract between a driver and whatever runs it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self

from di_envs.config import PRESETS
from di_envs.files.json_values import from_json, to_json
from di_envs.files.names import check_name, name_hint
from di_envs.files.text_enum import TextEnum
from di_envs.sensors.camera.config import Rig
from di_envs.sensors.lidar.config import LidarConfig
from di_envs.sensors.radar.config import RadarConfig
from di_envs.town.plan import RoutePlan
from di_envs.world.world import WorldView

Observation = Mapping[str, Any]
Control = NDArray[np.float32]  # (3,) throttle 0..1, steer -1..1 (positive right), brake 0..1
Memory = TypeVar("Memory")

# Options of its environment that an agent may ask for: where and among whom it is put to the test
# is not for it to choose.
SENSOR_OPTIONS: Mapping[str, Any] = {
    "cameras": str | Rig,
    "lidar": str | LidarConfig,
    "radars": tuple[RadarConfig, ...],
    "gnss_origin": tuple[float, float],
}


class Track(TextEnum):
    """What an agent may use; printed with every result."""

    PROMPT = "PROMPT"
    MAP = "MAP"
    SENSORS = "SENSORS"
    PRIVILEGED = "PRIVILEGED"


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """What an agent needs from its environment, and so its track: sensors, and how often it acts.

    Raises:
        ValueError: If it asks for anything else; names it.
    """

    observations: tuple[str, ...] = ("prompt",)
    control_dt_s: float = 0.1
    privileged: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)  # of `SENSOR_OPTIONS`
    hd_map: bool = False  # True: the static `Town` is in the observation under the key `town`
    branchable: bool = True  # False for an agent that hides memory outside its `Memory`
    preset: str = ""  # in which it learned, and makes of its observations itself; for the record

    def __post_init__(self) -> None:
        if not self.control_dt_s > 0.0:
            raise ValueError(f"control_dt_s must be positive, not {self.control_dt_s}")
        if self.preset:
            check_name(self.preset, PRESETS, "preset")
        for name in self.options:
            if name not in SENSOR_OPTIONS:
                raise ValueError(
                    f"an agent may not ask for '{name}': it says what it reads, its sensors and "
                    f"how often it acts; all else is for who evaluates it to say. "
                    f"Options: {name_hint(name, SENSOR_OPTIONS)}"
                )

    @classmethod
    def agreed(cls, asked: Any) -> Self:
        """What an agent says that it requires, checked: a copy, which it cannot change later.

        Raises:
            ValueError: If it is not of this form, or asks for what it may not.
        """
        try:
            return cls(
                observations=tuple(map(str, asked.observations)),
                control_dt_s=float(asked.control_dt_s),
                privileged=bool(asked.privileged),
                options=dict(asked.options),
                hd_map=bool(asked.hd_map),
                branchable=bool(asked.branchable),
                preset=str(getattr(asked, "preset", "")),
            )
        except (AttributeError, TypeError) as error:
            raise ValueError(
                f"an agent's `requires` is a Requirements (agents/base.py), not {asked!r}: {error}"
            ) from error

    def as_json(self) -> dict[str, Any]:
        """JSON values, for records and pipes."""
        values: dict[str, Any] = to_json(self)
        if not self.preset:  # as in records from before there were any
            del values["preset"]
        return values

    @classmethod
    def of_json(cls, values: Any) -> Self:
        """The inverse of `as_json`.

        Raises:
            ValueError: If they are no requirements, or ask for what they may not.
        """
        if isinstance(values, Mapping):
            values = {"preset": "", **values}
        read = from_json(cls, values, "requires", complete=True)
        return dataclasses.replace(read, options=sensors_of_json(read.options))

    @property
    def track(self) -> Track:
        """The track that these needs put an agent in."""
        if self.privileged:
            return Track.PRIVILEGED
        if self.hd_map:
            return Track.MAP
        asked = set(self.observations)
        if {"camera", "lidar", "radar", "proximity"} & asked or "prompt" not in asked:
            return Track.SENSORS
        return Track.PROMPT


def sensors_of_json(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of sensors, as `RouteEnv` takes them, of the JSON values that records keep.

    Raises:
        ValueError: If one of them is no sensor.
    """
    return {
        name: from_json(SENSOR_OPTIONS[name], value, "requires", f"options.{name}")
        for name, value in options.items()
    }


class Agent(Protocol[Memory]):
    """Chooses controls from what it `requires`, and from nothing else.

    All memory is a value, passed in and out, so that an episode can be branched with its agent:
    `act` changes neither the memory nor the observation that it is given.
    A privileged agent's observation holds a read-only `WorldView` under the key `world`.
    """

    requires: Requirements

    def start(self, plan: RoutePlan, seed: int) -> Memory:
        """The memory with which an episode along `plan` begins."""
        ...

    def act(self, observation: Observation, memory: Memory) -> tuple[Control, Memory]:
        """The control to hold for `requires.control_dt_s`, and the memory for the next call."""
        ...

    def close(self) -> None:
        """Frees what the agent holds."""
        ...


def make_control(throttle: float, steer: float, brake: float) -> Control:
    """A control, clipped to its range.

    Raises:
        ValueError: If a number is NaN: clipping would hide a driver's mistake.
    """
    if throttle != throttle or steer != steer or brake != brake:
        raise ValueError(f"control has NaN: throttle {throttle}, steer {steer}, brake {brake}")
    return np.array(
        [
            min(max(throttle, 0.0), 1.0),
            min(max(steer, -1.0), 1.0),
            min(max(brake, 0.0), 1.0),
        ],
        dtype=np.float32,
    )


__all__ = [
    "Agent",
    "Control",
    "Memory",
    "Observation",
    "Requirements",
    "Track",
    "WorldView",
    "make_control",
]
