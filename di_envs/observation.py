"""What a driver sees: the observation space by groups; `observer.py` fills it.

The space is one flat Dict of fixed shapes, padded with a validity column. Ego frame: metres, x
ahead, y right, yaw clockwise relative to the ego's; coordinates are clipped to ±100 m.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from di_envs.prompt import (
    COMPONENTS,
    LIGHTS,
    MAP_POLYLINES,
    OBSTACLES,
    POSITION_LIMIT_M,
    ROUTING_POINTS,
    SPEED_LIMIT_MPS,
    STOP_SIGNS,
)
from di_envs.sensors.camera.cameras import FAR_M
from di_envs.sensors.camera.config import Rig, rig_of
from di_envs.sensors.inertial import IMU_LIMIT
from di_envs.sensors.lidar.config import LidarConfig, lidar_of
from di_envs.sensors.proximity import AHEAD_M, CONTACTS
from di_envs.sensors.radar.config import FRONT_RADAR, RadarConfig
from di_envs.sensors.scene.tags import Tag
from di_envs.town.lanes import LightState
from di_envs.town.map_chunks import POINTS, MapKind
from di_envs.town.plan import RoadOption
from di_envs.world.state import SPEED_HISTORY, ActorKind

ODOMETRY_LIMIT_M = 1e5  # distances from the route's start are clipped to this

PI = float(np.float32(np.pi))  # as far as a yaw in single precision goes
_XY = (-POSITION_LIMIT_M, POSITION_LIMIT_M)
_YAW = (-PI, PI)
_SIZE = (0.0, 100.0)
_SPEED = (-SPEED_LIMIT_MPS, SPEED_LIMIT_MPS)
_VALID = (0.0, 1.0)
_MOST_ACTORS = float(2**24)

# (low, high) of each column, for the components that are tables
_COLUMNS: dict[str, tuple[tuple[int, ...], list[tuple[float, float]]]] = {
    "target_point": ((), [_XY, _XY, _YAW]),
    "routing": ((ROUTING_POINTS,), [_XY, _XY, _YAW, _VALID]),
    "map": ((MAP_POLYLINES, POINTS), [_XY, _XY, (0.0, float(max(MapKind))), _VALID]),
    "obstacles": (
        (OBSTACLES,),
        [_XY, _XY, _YAW, _SIZE, _SIZE, _SPEED, _SPEED, (0.0, float(max(ActorKind))), _VALID],
    ),
    "traffic_lights": ((LIGHTS,), [_XY, _XY, _YAW, (0.0, float(max(LightState))), _VALID]),
    "stop_signs": ((STOP_SIGNS,), [_XY, _XY, _YAW, _VALID]),
    "speed": ((), [_SPEED]),
    "speed_history": ((), [_SPEED] * SPEED_HISTORY),
    "imu": ((), [(-IMU_LIMIT, IMU_LIMIT)] * 6 + [(0.0, 2.0 * PI)]),
    "contacts": (
        (CONTACTS,),
        [(0.0, _MOST_ACTORS), (0.0, float(max(ActorKind))), (-100.0, 100.0), (-100.0, 100.0)],
    ),
    "obstacle": ((), [(0.0, _MOST_ACTORS), (0.0, float(max(ActorKind))), (0.0, AHEAD_M)]),
    "odometry": ((), [(-ODOMETRY_LIMIT_M, ODOMETRY_LIMIT_M)] * 2 + [_YAW]),
}


def observation_space(
    groups: tuple[str, ...],
    cameras: str | Rig = "small",
    lidar: str | LidarConfig = "paper",
    radars: tuple[RadarConfig, ...] = FRONT_RADAR,
    *,
    half_sweeps: bool = False,
) -> spaces.Dict:
    """The space of the groups asked for.

    Group `prompt`: `command` (RoadOption at the next target point, 0 for none), `target_point`
    (x, y, yaw), `routing` (x, y, yaw, valid: the next 50 points at 1 m), `map` (x, y, `MapKind`,
    valid: the 64 lane and line polylines nearest to the ego within 50 m), `obstacles` (x, y, yaw,
    length, width, vx, vy, `ActorKind`, valid: the 32 nearest within 80 m), `traffic_lights` (stop
    line's x, y, yaw, `LightState`, valid: the 8 nearest lanes' within 50 m), `stop_signs` (stop
    line's x, y, yaw, valid: the 4 nearest within 50 m), `speed` [m/s], `speed_history` [m/s] at
    0.5, 1, 1.5 and 2 s ago, `prompt_present` (one flag a component, in the order of
    `prompt.COMPONENTS`).

    Group `inertial`: `imu` (ax, ay, az [m/s2], gx, gy, gz [rad/s], compass [rad]) and `gnss`
    (latitude, longitude [deg], altitude [m]; double precision, as a single one is 0.4 m coarse),
    and the speedometer, which is the prompt's `speed`.

    Group `odometry`: `odometry` (3,) x ahead, y right [m], yaw of the ego in the frame of the
    route's first point: how far it has come since the start. It carries the speed, so it is a group
    of its own.

    Group `camera`: for each camera of the rig `cameras` its RGB image (H, W, 3) under its name, and
    what else the rig asks for (see `Rig`).

    Group `lidar`: `lidar` (rays, 4) x, y, z in the ego's frame [m] and intensity of each ray's hit,
    zeros for rays that hit nothing or were dropped; and what else is asked for (see `LidarConfig`).
    With `half_sweeps` it has the rows of the half that the tick scanned (see `sensors/lidar.py`).

    Group `radar`: for each radar (rays, 4) distance [m], azimuth to the right and elevation [rad]
    in its own frame, speed away from it [m/s]; zeros for rays that met nothing.

    Group `proximity`: `contacts`, `obstacle`, `across_line` (see `sensors/proximity.py`).
    """
    space: dict[str, spaces.Space[Any]] = {}
    if "prompt" in groups:
        space["command"] = spaces.Discrete(len(RoadOption))  # VOID gives way to 0, none
        space.update({name: _table(name) for name in COMPONENTS if name != "command"})
        space["prompt_present"] = spaces.MultiBinary(len(COMPONENTS))
    if "inertial" in groups:
        space["imu"] = _table("imu")
        space["gnss"] = spaces.Box(
            np.array([-90.0, -180.0, -1e4]), np.array([90.0, 180.0, 1e4]), dtype=np.float64
        )
        space["speed"] = _table("speed")
    if "odometry" in groups:
        space["odometry"] = _table("odometry")
    if "camera" in groups:
        space.update(_image_spaces(rig_of(cameras)))
    if "lidar" in groups:
        space.update(_lidar_spaces(lidar_of(lidar), half_sweeps))
    if "radar" in groups:
        space.update({radar.name: _radar_space(radar) for radar in radars})
    if "proximity" in groups:
        space.update({name: _table(name) for name in ("contacts", "obstacle")})
        space["across_line"] = spaces.MultiBinary(1)
    return spaces.Dict(space)


def _lidar_spaces(config: LidarConfig, half_sweeps: bool) -> dict[str, spaces.Space[Any]]:
    far = np.float32(config.reach_m)
    rays = config.channels * (config.half_steps if half_sweeps else config.steps)
    high = np.tile(np.array([far, far, far, 1.0], np.float32), (rays, 1))
    low = -high
    low[:, 3] = 0.0
    points: dict[str, spaces.Space[Any]] = {"lidar": spaces.Box(low, high, dtype=np.float32)}
    if config.semantic:
        points["lidar_semantic"] = spaces.Box(0, max(Tag), (rays,), np.uint8)
    if config.instance:
        most = int(np.iinfo(np.int32).max)
        points["lidar_instance"] = spaces.Box(0, most, (rays,), np.int32)
        points["lidar_incidence"] = spaces.Box(0.0, 1.0, (rays,), np.float32)
    return points


def _radar_space(config: RadarConfig) -> spaces.Box:
    turn = PI / 2.0
    high = np.tile(
        np.array([config.range_m, turn, turn, 2.0 * SPEED_LIMIT_MPS], np.float32), (config.rays, 1)
    )
    low = -high
    low[:, 0] = 0.0
    return spaces.Box(low, high, dtype=np.float32)


def _image_spaces(rig: Rig) -> dict[str, spaces.Space[Any]]:
    images: dict[str, spaces.Space[Any]] = {}
    for camera in rig.cameras:
        size = (camera.height, camera.width)
        images[camera.name] = spaces.Box(0, 255, (*size, 3), np.uint8)
        if rig.depth:
            images[f"{camera.name}_depth"] = spaces.Box(0.0, FAR_M, size, np.float32)
        if rig.semantic:
            images[f"{camera.name}_semantic"] = spaces.Box(0, max(Tag), size, np.uint8)
        if rig.instance:
            most = int(np.iinfo(np.int32).max)
            images[f"{camera.name}_instance"] = spaces.Box(0, most, size, np.int32)
    return images


def _table(name: str) -> spaces.Box:
    leading, columns = _COLUMNS[name]
    low, high = np.array(columns, np.float32).T
    shape = (*leading, len(columns))
    return spaces.Box(np.broadcast_to(low, shape), np.broadcast_to(high, shape), dtype=np.float32)
