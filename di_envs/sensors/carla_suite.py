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

import warnings
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from di_envs.sensors.camera.config import Rig
from di_envs.sensors.carla_sensor import CarlaSensor, SensorSuiteError, sensor_of
from di_envs.sensors.carla_types import (
    EVENTS,
    FEW,
    IMAGES,
    LIDARS,
    MANY,
    SensorType,
)
from di_envs.sensors.lidar.config import LidarConfig, lidar_of
from di_envs.sensors.radar.config import MOST_RADARS

LEADERBOARDS = ("1.0", "2.0", "2.1")
TRACKS = ("SENSORS", "MAP")  # in 2.x also with _QUALIFIER behind: fewer sensors
LIMITS = ("none", "leaderboard")


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
    found = tuple(sensor_of(given, number, strict=strict) for number, given in enumerate(sensors))
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
