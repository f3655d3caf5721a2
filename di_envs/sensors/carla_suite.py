"""Sensor suites as agents of the CARLA Leaderboard ask for them, checked and made into ours.

An agent's `sensors()` returns a list of dicts, each with CARLA's `type`, an `id` of the agent's own
and a place. Everything that the Leaderboard sets itself is as it sets it (a LiDAR of 64 channels,
85 m, 10 turns a second; a radar of 1500 points a second, 100 m). Keys that it does not read are
ignored, as there.

Evaluators that come with published agents allow more than the Leaderboard's own: sensors within
1,000 m, semantic cameras, collision sensors. So do we, unless its limits are asked for. What a
sensor asks for and this world cannot turn (a rolled camera, a tilted LiDAR or IMU, a second LiDAR)
gives empty data, and one warning says so.

Source: rules of the Leaderboard's branches `leaderboard-1.0`, `leaderboard-2.0` and
`leaderboard-2.1`.
"""

from __future__ import annotations

import difflib
import math
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from di_envs.files.names import name_hint
from di_envs.sensors.camera.config import CameraConfig, Rig
from di_envs.sensors.carla_types import (
    EVENTS,
    FEW,
    IMAGES,
    LIDARS,
    MANY,
    NOT_SIMULATED,
    NUMBERS,
    STITCHED,
    SensorType,
)
from di_envs.sensors.lidar.config import LidarConfig, lidar_of
from di_envs.sensors.radar.config import MOST_RADARS, RadarConfig

STRICT_REACH_M = 3.0  # from the ego's origin to a sensor, by the Leaderboard's rules
REACH_M = 1000.0  # … and by those of evaluators that come with agents
LEADERBOARDS = ("1.0", "2.0", "2.1")
TRACKS = ("SENSORS", "MAP")  # in 2.x also with _QUALIFIER behind: fewer sensors
LIMITS = ("none", "leaderboard")
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


@dataclass(frozen=True, kw_only=True)
class CarlaSuite:
    """A checked suite, and what an environment must be told to show it."""

    track: str
    sensors: tuple[CarlaSensor, ...]
    leaderboard: str = "1.0"

    @property
    def _seen(self) -> tuple[CarlaSensor, ...]:
        """Those that are not empty."""
        return tuple(sensor for sensor in self.sensors if not sensor.empty)

    @property
    def observations(self) -> tuple[str, ...]:
        """The groups of observations that hold what the sensors see; at least one."""
        types = {sensor.type for sensor in self._seen}
        groups = [
            group
            for group, kinds in (
                ("camera", IMAGES),
                ("lidar", LIDARS),
                ("radar", (SensorType.RADAR,)),
                ("proximity", EVENTS),
            )
            if types & set(kinds)
        ]
        if types & {SensorType.GNSS, SensorType.IMU, SensorType.SPEEDOMETER} or not groups:
            groups.append("inertial")
        return tuple(groups)

    @property
    def options(self) -> dict[str, Any]:
        """Environment options: the cameras, the LiDAR and the radars, where there are any."""
        seen, types = self._seen, {sensor.type for sensor in self._seen}
        cameras = {camera.name: camera for sensor in seen for camera in sensor.cameras}
        options: dict[str, Any] = {}
        if cameras:
            tagged = {SensorType.SEMANTIC, SensorType.STITCHED_SEMANTIC, SensorType.INSTANCE}
            options["cameras"] = Rig(
                cameras=tuple(cameras.values()),
                depth=SensorType.DEPTH in types,
                semantic=bool(types & tagged),
                instance=SensorType.INSTANCE in types,
            )
        for sensor in seen:
            if sensor.type in LIDARS:
                options["lidar"] = lidar_at(sensor)
        radars = tuple(sensor.radar for sensor in seen if sensor.radar is not None)
        return {**options, "radars": radars} if radars else options

    @property
    def with_map(self) -> bool:
        """Whether the town's OpenDRIVE file is among what is seen."""
        return any(sensor.type == SensorType.MAP for sensor in self.sensors)


def lidar_at(sensor: CarlaSensor) -> LidarConfig:
    """The Leaderboard's LiDAR, mounted where a suite has it; a semantic one loses no rays."""
    config = replace(lidar_of("leaderboard"), x_m=sensor.x_m, y_m=sensor.y_m, z_m=sensor.z_m)
    if sensor.type == SensorType.LIDAR:
        return config
    return replace(config, dropoff=0.0, dropoff_zero=0.0, semantic=True, instance=True)


def suite_of(
    sensors: Iterable[Mapping[str, Any]],
    track: str = "SENSORS",
    leaderboard: str = "1.0",
    limits: str = "none",
) -> CarlaSuite:
    """Checks what an agent's `sensors()` returned.

    Args:
        sensors: Dicts with `type`, `id` and what the type needs: metres and degrees.
        track: The agent's: `SENSORS` or `MAP`, in 2.x also `SENSORS_QUALIFIER`, `MAP_QUALIFIER`.
        leaderboard: Version of the Leaderboard whose tracks, limits and tags hold.
        limits: `leaderboard` to refuse what that version refuses.

    Raises:
        SensorSuiteError: If a type is unknown, an id is missing or given twice, a number is missing
            or impossible, a sensor is too far away, or there are too many.
    """
    allowed = _allowed(track, leaderboard)
    if isinstance(sensors, str | bytes | Mapping) or not isinstance(sensors, Iterable):
        raise SensorSuiteError(f"sensors() must return a list of dicts; got {sensors!r}.")
    strict = limits == "leaderboard"
    found = tuple(_sensor(given, number, strict) for number, given in enumerate(sensors))
    for id_, count in Counter(sensor.id for sensor in found).items():
        if count > 1:
            raise SensorSuiteError(f"Sensor ids are unique; '{id_}' is given {count} times.")
    if strict:
        _check_limits(found, allowed, track, leaderboard)
    found = _with_empty_ones(found)
    _warn_of_empty_ones(found)
    return CarlaSuite(track=track, sensors=found, leaderboard=leaderboard)


def _check_limits(
    sensors: tuple[CarlaSensor, ...],
    allowed: Mapping[SensorType, int],
    track: str,
    leaderboard: str,
) -> None:
    """Refuses what the Leaderboard refuses."""
    for type_, count in Counter(sensor.type for sensor in sensors).items():
        name = type_ or next(str(s.given["type"]) for s in sensors if s.type is None)
        most = allowed.get(type_, 0) if type_ is not None else 0
        if count > most:
            raise SensorSuiteError(
                f"Too many sensors of type {name}: {count}; track {track} of Leaderboard "
                f"{leaderboard} allows {most}."
            )
        if type_ == SensorType.MAP and not track.startswith("MAP"):
            raise SensorSuiteError(
                f"{SensorType.MAP} is for agents of track MAP; this one's is {track}. "
                f"Set self.track in setup()."
            )


def _with_empty_ones(sensors: tuple[CarlaSensor, ...]) -> tuple[CarlaSensor, ...]:
    """The sensors, those marked empty of which there are more than this world carries."""
    left, kept = {"LiDAR": 1, "radars": MOST_RADARS}, []
    for sensor in sensors:
        kind = "LiDAR" if sensor.type in LIDARS else "radars" if sensor.radar else ""
        if kind and not sensor.empty:
            left[kind] -= 1
            if left[kind] < 0:
                most = 1 if kind == "LiDAR" else MOST_RADARS
                sensor = replace(sensor, empty=f"this world carries {most} {kind}")
        kept.append(sensor)
    return tuple(kept)


def _warn_of_empty_ones(sensors: tuple[CarlaSensor, ...]) -> None:
    empty = [f"'{sensor.id}' ({sensor.empty})" for sensor in sensors if sensor.empty]
    if empty:
        warnings.warn(f"Sensors that give empty data: {', '.join(empty)}.", stacklevel=3)


def _allowed(track: str, leaderboard: str) -> Mapping[SensorType, int]:
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
    return FEW if leaderboard == "1.0" or track.endswith("_QUALIFIER") else MANY


def _sensor(given: Any, number: int, strict: bool) -> CarlaSensor:
    """One dict of a suite, checked."""
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
