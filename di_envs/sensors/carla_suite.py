"""Sensor suites as agents of the CARLA Leaderboard ask for them, checked and made into ours.

An agent's `sensors()` returns a list of dicts, each with CARLA's `type`, an `id` of the agent's own
and a place. Types, limits, the 3 m round the ego and everything that the Leaderboard sets itself (a
LiDAR of 64 channels, 85 m, 10 turns a second) are the Leaderboard's, for its versions 1.0 and 2.x.
Keys that CARLA does not read are ignored, as there.

Source: rules of the Leaderboard's branches `leaderboard-1.0`, `leaderboard-2.0` and
`leaderboard-2.1`. Not simulated, and refused: radars, a second LiDAR, cameras that are rolled and
LiDARs or IMUs that are tilted.
"""

from __future__ import annotations

import difflib
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from di_envs.files.names import name_hint
from di_envs.files.text_enum import TextEnum
from di_envs.sensors.camera.config import CameraConfig, Rig
from di_envs.sensors.lidar.config import LidarConfig, lidar_of


class SensorType(TextEnum):
    """CARLA's names of the sensors that the Leaderboard allows."""

    CAMERA = "sensor.camera.rgb"
    LIDAR = "sensor.lidar.ray_cast"
    RADAR = "sensor.other.radar"
    GNSS = "sensor.other.gnss"
    IMU = "sensor.other.imu"
    SPEEDOMETER = "sensor.speedometer"
    MAP = "sensor.opendrive_map"


REACH_M = 3.0  # from the ego's origin to a sensor
LEADERBOARDS = ("1.0", "2.0", "2.1")
TRACKS = ("SENSORS", "MAP")  # in 2.x also with _QUALIFIER behind: fewer sensors

_ONE_EACH = {SensorType.GNSS: 1, SensorType.IMU: 1, SensorType.SPEEDOMETER: 1, SensorType.MAP: 1}
_FEW = {
    SensorType.CAMERA: 4,
    SensorType.LIDAR: 1,
    SensorType.RADAR: 2,
    **_ONE_EACH,
}  # 1.0, and the qualifiers of 2.x
_MANY = {SensorType.CAMERA: 8, SensorType.LIDAR: 2, SensorType.RADAR: 4, **_ONE_EACH}

_PLACE, _ANGLES = ("x", "y", "z"), ("roll", "pitch", "yaw")
_NUMBERS = {
    SensorType.CAMERA: (*_PLACE, *_ANGLES, "width", "height", "fov"),
    SensorType.LIDAR: (*_PLACE, *_ANGLES),
    SensorType.RADAR: (*_PLACE, *_ANGLES),
    SensorType.GNSS: _PLACE,
    SensorType.IMU: (*_PLACE, *_ANGLES),
    SensorType.SPEEDOMETER: (),
    SensorType.MAP: (),
}


class SensorSuiteError(ValueError):
    """A sensor suite that the Leaderboard, or this world, refuses; says which sensor and why."""


@dataclass(frozen=True, kw_only=True)
class CarlaSensor:
    """One sensor of a suite.

    Attributes:
        id: The agent's own name for it.
        type: CARLA's type, such as `sensor.camera.rgb`.
        x_m: Mounting in the ego's frame, ahead.
        y_m: … to the right.
        z_m: … above the ground.
        yaw_rad: Turned to the right.
        camera: What a camera is, under the key of its images; None for other types.
    """

    id: str
    type: SensorType
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    yaw_rad: float = 0.0
    camera: CameraConfig | None = None


@dataclass(frozen=True, kw_only=True)
class CarlaSuite:
    """A checked suite, and what an environment must be told to show it."""

    track: str
    sensors: tuple[CarlaSensor, ...]

    @property
    def observations(self) -> tuple[str, ...]:
        """The groups of observations that hold what the sensors see; at least one."""
        types = {sensor.type for sensor in self.sensors}
        groups = [
            group
            for group, kind in (("camera", SensorType.CAMERA), ("lidar", SensorType.LIDAR))
            if kind in types
        ]
        if types & {SensorType.GNSS, SensorType.IMU, SensorType.SPEEDOMETER} or not groups:
            groups.append("inertial")
        return tuple(groups)

    @property
    def options(self) -> dict[str, Any]:
        """Environment options: the cameras and the LiDAR, where there are any."""
        cameras = tuple(sensor.camera for sensor in self.sensors if sensor.camera is not None)
        options: dict[str, Any] = {"cameras": Rig(cameras=cameras)} if cameras else {}
        for sensor in self.sensors:
            if sensor.type == SensorType.LIDAR:
                options["lidar"] = lidar_at(sensor)
        return options

    @property
    def with_map(self) -> bool:
        """Whether the town's OpenDRIVE file is among what is seen."""
        return any(sensor.type == SensorType.MAP for sensor in self.sensors)


def lidar_at(sensor: CarlaSensor) -> LidarConfig:
    """The Leaderboard's LiDAR, mounted where a suite has it."""
    return replace(lidar_of("leaderboard"), x_m=sensor.x_m, y_m=sensor.y_m, z_m=sensor.z_m)


def suite_of(
    sensors: Iterable[Mapping[str, Any]], track: str = "SENSORS", leaderboard: str = "1.0"
) -> CarlaSuite:
    """Checks what an agent's `sensors()` returned.

    Args:
        sensors: Dicts with `type`, `id` and what the type needs: metres and degrees.
        track: The agent's: `SENSORS` or `MAP`, in 2.x also `SENSORS_QUALIFIER`, `MAP_QUALIFIER`.
        leaderboard: Version of the Leaderboard whose limits hold.

    Raises:
        SensorSuiteError: If a type is unknown or not simulated, an id is missing or given twice, a
            number is missing or impossible, a sensor is too far away, or there are too many.
    """
    limits = _limits(track, leaderboard)
    if isinstance(sensors, str | bytes | Mapping) or not isinstance(sensors, Iterable):
        raise SensorSuiteError(f"sensors() must return a list of dicts; got {sensors!r}.")
    found = tuple(_sensor(given, number) for number, given in enumerate(sensors))
    for id_, count in Counter(sensor.id for sensor in found).items():
        if count > 1:
            raise SensorSuiteError(f"Sensor ids are unique; '{id_}' is given {count} times.")
    for type_, count in Counter(sensor.type for sensor in found).items():
        if count > limits[type_]:
            raise SensorSuiteError(
                f"Too many sensors of type {type_}: {count}; track {track} of Leaderboard "
                f"{leaderboard} allows {limits[type_]}."
            )
        if type_ == SensorType.MAP and not track.startswith("MAP"):
            raise SensorSuiteError(
                f"{SensorType.MAP} is for agents of track MAP; this one's is {track}. "
                f"Set self.track in setup()."
            )
        if type_ == SensorType.LIDAR and count > 1:
            raise SensorSuiteError(
                f"This world carries one {SensorType.LIDAR}, not {count}; leave one out."
            )
    return CarlaSuite(track=track, sensors=found)


def _limits(track: str, leaderboard: str) -> Mapping[SensorType, int]:
    if leaderboard not in LEADERBOARDS:
        raise SensorSuiteError(
            f"Unknown Leaderboard '{leaderboard}'; known: {', '.join(LEADERBOARDS)}."
        )
    known: tuple[str, ...] = TRACKS
    if leaderboard != "1.0":
        known = (*TRACKS, *(f"{track}_QUALIFIER" for track in TRACKS))
    if track not in known:
        raise SensorSuiteError(
            f"Unknown track {track!r}; Leaderboard {leaderboard} has {', '.join(known)}."
        )
    return _FEW if leaderboard == "1.0" or track.endswith("_QUALIFIER") else _MANY


def _sensor(given: Any, number: int) -> CarlaSensor:
    """One dict of a suite, checked."""
    if not isinstance(given, Mapping):
        raise SensorSuiteError(f"Sensor {number} must be a dict with type and id; got {given!r}.")
    id_, type_ = given.get("id"), given.get("type")
    if not isinstance(id_, str) or not id_:
        raise SensorSuiteError(f"Sensor {number} ({type_}) needs an 'id', a string; got {id_!r}.")
    if str(type_) not in list(SensorType):
        raise SensorSuiteError(
            f"Sensor '{id_}': unknown type {type_!r}; {name_hint(type_, _NUMBERS)}."
        )
    if type_ == SensorType.RADAR:
        raise SensorSuiteError(
            f"Sensor '{id_}': radars are not simulated; leave {SensorType.RADAR} out of sensors()."
        )
    type_ = SensorType(str(type_))
    number_of = {key: _number(given, key, id_) for key in _NUMBERS[type_]}
    _check_place(number_of, id_)
    _check_angles(number_of, id_, type_)
    return CarlaSensor(
        id=id_,
        type=type_,
        x_m=number_of.get("x", 0.0),
        y_m=number_of.get("y", 0.0),
        z_m=number_of.get("z", 0.0),
        yaw_rad=math.radians(number_of.get("yaw", 0.0)),
        camera=_camera(number_of, id_) if type_ == SensorType.CAMERA else None,
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


def _check_place(number_of: Mapping[str, float], id_: str) -> None:
    far_m = math.hypot(*(number_of.get(axis, 0.0) for axis in _PLACE))
    if far_m > REACH_M:
        raise SensorSuiteError(
            f"Sensor '{id_}' is {far_m:.2f} m from the ego's origin; the Leaderboard allows "
            f"{REACH_M:g} m."
        )


def _check_angles(number_of: Mapping[str, float], id_: str, type_: SensorType) -> None:
    """Refuses what this world cannot turn: its cameras have no roll, its LiDAR spins level."""
    level: dict[SensorType, tuple[str, ...]] = {
        SensorType.CAMERA: ("roll",),
        SensorType.LIDAR: ("roll", "pitch"),
        SensorType.IMU: ("roll", "pitch"),
    }
    for angle in level.get(type_, ()):
        if (number_of[angle] + 180.0) % 360.0 != 180.0:
            raise SensorSuiteError(
                f"Sensor '{id_}': a {type_} with {angle} is not simulated; got "
                f"{number_of[angle]:g} degrees, set it to 0."
            )


def _camera(number_of: Mapping[str, float], id_: str) -> CameraConfig:
    for side in ("width", "height"):
        if not number_of[side].is_integer():
            raise SensorSuiteError(
                f"Sensor '{id_}': {side} is a number of pixels; got {number_of[side]:g}."
            )
    try:
        return CameraConfig(
            name=f"camera_{id_}",
            width=int(number_of["width"]),
            height=int(number_of["height"]),
            fov_deg=number_of["fov"],
            x_m=number_of["x"],
            y_m=number_of["y"],
            z_m=number_of["z"],
            yaw_rad=math.radians(number_of["yaw"]),
            pitch_rad=math.radians(number_of["pitch"]),
        )
    except ValueError as error:
        raise SensorSuiteError(f"Sensor '{id_}': {error}") from error
