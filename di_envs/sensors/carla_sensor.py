"""One sensor as agents of the CARLA Leaderboard ask for it, checked and made into ours.

A dict with CARLA's `type`, an `id` of the agent's own and a place. What it asks for and this world
cannot turn (a rolled camera, a tilted LiDAR or IMU) gives empty data, and says why.

Source: rules of the Leaderboard's branches `leaderboard-1.0`, `leaderboard-2.0` and
`leaderboard-2.1`.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from di_envs.files.names import name_hint
from di_envs.sensors.camera.config import CameraConfig
from di_envs.sensors.carla_types import (
    IMAGES,
    LIDARS,
    NOT_SIMULATED,
    NUMBERS,
    STITCHED,
    SensorType,
)
from di_envs.sensors.radar.config import RadarConfig

STRICT_REACH_M = 3.0  # from the ego's origin to a sensor, by the Leaderboard's rules
REACH_M = 1000.0  # … and by those of evaluators that come with agents
_STITCH_DEG = 5.0  # by which the images of a stitched camera overlap


class SensorSuiteError(ValueError):
    """A sensor suite that the Leaderboard, or this world, refuses; says which sensor and why."""


@dataclass(frozen=True, kw_only=True)
class CarlaSensor:
    """One sensor of a suite.

    Attributes:
        id: The agent's own name for it.
        type: CARLA's type, such as `sensor.camera.rgb`; None for one that is not simulated.
        x_m: Mounting in the ego's frame, ahead.
        y_m: … to the right.
        z_m: … above the ground.
        yaw_rad: Turned to the right.
        cameras: What its images are taken with, each under the key of its images: one for a camera,
            three for a stitched one, none for other types.
        radar: What a radar is, under the key of its rows.
        empty: Why it gives empty data; "" where it does not.
        given: What else it was given, such as the `distance` of an obstacle sensor.
    """

    id: str
    type: SensorType | None
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    yaw_rad: float = 0.0
    cameras: tuple[CameraConfig, ...] = ()
    radar: RadarConfig | None = None
    empty: str = ""
    given: Mapping[str, Any] = field(default_factory=dict)


def sensor_of(given: Any, number: int, *, strict: bool) -> CarlaSensor:
    """Checks one of what an agent's `sensors()` returned.

    Args:
        given: A dict with `type`, `id` and what the type needs: metres and degrees.
        number: Its place in the list, for messages.
        strict: Whether it must be as near as the Leaderboard asks.

    Raises:
        SensorSuiteError: If it is no dict, its type is unknown, its id or a number is missing or
            impossible, or it is too far away.
    """
    if not isinstance(given, Mapping):
        raise SensorSuiteError(f"Sensor {number} must be a dict with type and id; got {given!r}.")
    id_, type_ = given.get("id"), given.get("type")
    if not isinstance(id_, str) or not id_:
        raise SensorSuiteError(f"Sensor {number} ({type_}) needs an 'id', a string; got {id_!r}.")
    if type_ in NOT_SIMULATED:
        return CarlaSensor(
            id=id_, type=None, empty=f"{type_} is not simulated", given={"type": type_}
        )
    if str(type_) not in list(SensorType):
        raise SensorSuiteError(
            f"Sensor '{id_}': unknown type {type_!r}; {name_hint(type_, NUMBERS)}."
        )
    type_ = SensorType(str(type_))
    number_of = {key: _number(given, key, id_) for key in NUMBERS[type_]}
    _check_place(number_of, id_, strict)
    empty = _cannot_be_turned(number_of, type_)
    return CarlaSensor(
        id=id_,
        type=type_,
        x_m=number_of.get("x", 0.0),
        y_m=number_of.get("y", 0.0),
        z_m=number_of.get("z", 0.0),
        yaw_rad=math.radians(number_of.get("yaw", 0.0)),
        cameras=_cameras(number_of, id_, type_) if type_ in IMAGES else (),
        radar=_radar(number_of, id_) if type_ == SensorType.RADAR else None,
        empty=empty,
        given={key: given[key] for key in ("distance", "only_dynamics") if key in given},
    )


def _number(given: Mapping[str, Any], key: str, id_: str) -> float:
    if key not in given:
        near = difflib.get_close_matches(key, [str(name) for name in given], n=1)
        hint = f"; did you mean it by '{near[0]}'?" if near else "."
        raise SensorSuiteError(f"Sensor '{id_}' ({given['type']}) lacks '{key}'{hint}")
    try:
        value = float(given[key])
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise SensorSuiteError(f"Sensor '{id_}': {key} must be a number; got {given[key]!r}.")
    return value


def _check_place(number_of: Mapping[str, float], id_: str, strict: bool) -> None:
    far_m = math.hypot(*(number_of.get(axis, 0.0) for axis in ("x", "y", "z")))
    most_m = STRICT_REACH_M if strict else REACH_M
    if far_m > most_m:
        raise SensorSuiteError(
            f"Sensor '{id_}' is {far_m:.2f} m from the ego's origin; "
            f"{'the Leaderboard allows' if strict else 'at most'} {most_m:g} m."
        )


def _cannot_be_turned(number_of: Mapping[str, float], type_: SensorType) -> str:
    """Why a sensor cannot be as it is asked for: cameras have no roll, a LiDAR spins level."""
    level: dict[SensorType, tuple[str, ...]] = {
        **dict.fromkeys(IMAGES, ("roll",)),
        **dict.fromkeys(LIDARS, ("roll", "pitch")),
        SensorType.IMU: ("roll", "pitch"),
    }
    for angle in level.get(type_, ()):
        if (number_of[angle] + 180.0) % 360.0 != 180.0:
            return f"{angle} of a {type_} is not simulated"
    if type_ in IMAGES and abs(_pitch_deg(number_of)) > 90.0:
        return f"a {type_} pitched by more than 90 degrees is not simulated"
    if type_ in LIDARS and max(abs(number_of[axis]) for axis in ("x", "y", "z")) > 20.0:
        return f"a {type_} more than 20 m away is not simulated"
    return ""


def _pitch_deg(number_of: Mapping[str, float]) -> float:
    """A pitch within half a turn: -90 for 270."""
    return math.remainder(number_of["pitch"], 360.0)


def _cameras(
    number_of: Mapping[str, float], id_: str, type_: SensorType
) -> tuple[CameraConfig, ...]:
    """A camera, or the three of a stitched one, from left to right."""
    if type_ not in STITCHED:
        return (_camera(number_of, id_, 0.0, ""),)
    aside = float(int(number_of["fov"])) - _STITCH_DEG
    return tuple(
        _camera(number_of, id_, turn, f"_{side}")
        for side, turn in (("left", -aside), ("center", 0.0), ("right", aside))
    )


def _camera(number_of: Mapping[str, float], id_: str, turn_deg: float, side: str) -> CameraConfig:
    for length in ("width", "height"):
        if not number_of[length].is_integer():
            raise SensorSuiteError(
                f"Sensor '{id_}': {length} is a number of pixels; got {number_of[length]:g}."
            )
    pitch_deg = min(max(_pitch_deg(number_of), -90.0), 90.0)
    try:
        return CameraConfig(
            name=f"camera_{id_}{side}",
            width=int(number_of["width"]),
            height=int(number_of["height"]),
            fov_deg=number_of["fov"],
            x_m=number_of["x"],
            y_m=number_of["y"],
            z_m=number_of["z"],
            yaw_rad=math.radians(number_of["yaw"] + turn_deg),
            pitch_rad=math.radians(pitch_deg),
        )
    except ValueError as error:
        raise SensorSuiteError(f"Sensor '{id_}': {error}") from error


def _radar(number_of: Mapping[str, float], id_: str) -> RadarConfig:
    try:
        return RadarConfig(
            name=f"radar_{id_}",
            fov_deg=number_of["fov"],
            x_m=number_of["x"],
            y_m=number_of["y"],
            z_m=number_of["z"],
            yaw_rad=math.radians(number_of["yaw"]),
            pitch_rad=math.radians(number_of["pitch"]),
            roll_rad=math.radians(number_of["roll"]),
        )
    except ValueError as error:
        raise SensorSuiteError(f"Sensor '{id_}': {error}") from error
