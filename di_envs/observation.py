"""What a driver sees: the observation space by groups, and the observer that fills it.

The space is one flat Dict of fixed shapes, padded with a validity column. Ego frame: metres, x
ahead, y right, yaw clockwise relative to the ego's; coordinates are clipped to ±100 m.
"""

from __future__ import annotations

import copy
import math
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import bind, kernel
from di_envs.prompt import (
    COMPONENTS,
    LIGHTS,
    MAP_POLYLINES,
    OBSTACLES,
    POSITION_LIMIT_M,
    ROUTING_POINTS,
    SPEED_LIMIT_MPS,
    STOP_SIGNS,
    Prompt,
    PromptRoute,
    StopLines,
    empty_prompt,
    fill_prompt,
    prompt_route_of,
    stop_lines_of,
)
from di_envs.sensors.camera.cameras import FAR_M, CameraRig
from di_envs.sensors.camera.config import Rig, rig_of
from di_envs.sensors.inertial import IMU_LIMIT, fill_gnss, fill_imu
from di_envs.sensors.lidar.config import LidarConfig, lidar_of
from di_envs.sensors.lidar.sweep import Lidar
from di_envs.sensors.scene.tags import Tag
from di_envs.sensors.weather import weather_of
from di_envs.town.lanes import Lanes, LightState
from di_envs.town.map_chunks import POINTS, MapChunks, MapKind, build_map_chunks
from di_envs.town.plan import RoadOption
from di_envs.town.town import Town
from di_envs.world.state import SPEED_HISTORY, ActorKind, State
from di_envs.world.world import WorldView

ODOMETRY_LIMIT_M = 1e5  # distances from the route's start are clipped to this

_PI = float(np.float32(np.pi))
_XY = (-POSITION_LIMIT_M, POSITION_LIMIT_M)
_YAW = (-_PI, _PI)
_SIZE = (0.0, 100.0)
_SPEED = (-SPEED_LIMIT_MPS, SPEED_LIMIT_MPS)
_VALID = (0.0, 1.0)

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
    "imu": ((), [(-IMU_LIMIT, IMU_LIMIT)] * 6 + [(0.0, 2.0 * _PI)]),
    "odometry": ((), [(-ODOMETRY_LIMIT_M, ODOMETRY_LIMIT_M)] * 2 + [_YAW]),
}


def observation_space(
    groups: tuple[str, ...],
    cameras: str | Rig = "small",
    lidar: str | LidarConfig = "paper",
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
    return points


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


@by_reference
class Sight(NamedTuple):
    """All that one look at the world reads and writes: one argument, as each costs time."""

    state: State
    route: PromptRoute
    stop_lines: StopLines
    lanes: Lanes
    chunks: MapChunks
    geo_origin: NDArray[np.float64]  # (2,) latitude, longitude [deg]
    prompt: Prompt  # written, as are the rest
    imu: NDArray[np.float32]  # (7,)
    gnss: NDArray[np.float64]  # (3,)


@kernel
def fill_observation(sight, ego, with_prompt, with_inertial):  # type: ignore[no-untyped-def]
    """Writes the groups that are asked for, for one ego."""
    if with_prompt:
        fill_prompt(sight.state, sight.route, sight.stop_lines, sight.chunks, ego, sight.prompt)
    if with_inertial:
        fill_imu(sight.state, sight.lanes, ego, sight.imu)
        fill_gnss(sight.state, ego, sight.geo_origin[0], sight.geo_origin[1], sight.gnss)


def prompt_observation(prompt: Prompt) -> dict[str, NDArray[Any]]:
    """Copies of a prompt's arrays by name, or of those of many worlds, with all flags of presence.

    `command` keeps its last axis, of length 1.
    """
    found = {name: getattr(prompt, name).copy() for name in COMPONENTS}
    found["prompt_present"] = np.ones((*prompt.command.shape[:-1], len(COMPONENTS)), np.int8)
    return found


class Observer:
    """Looks at a world through one ego's eyes. Keeps no memory: only buffers and static tables.

    Attributes:
        weather: What cameras see from the next `start` on.
    """

    def __init__(
        self,
        town: Town,
        groups: tuple[str, ...],
        ego: int = 0,
        *,
        cameras: str | Rig = "small",
        lidar: str | LidarConfig = "paper",
        half_sweeps: bool = False,
        weather: str | None = None,
    ) -> None:
        """Prepares to look.

        Args:
            town: The town.
            groups: Groups of observations.
            ego: Index of the ego that looks.
            cameras: Its rig, or the name of a shipped one; for group `camera`.
            lidar: Its LiDAR, or the name of a shipped one; for group `lidar`.
            half_sweeps: It looks at every tick, so it sees half a turn of the LiDAR each time.
            weather: What cameras see, one of CARLA's presets; None for ClearNoon.
        """
        self._with_prompt, self._with_inertial = "prompt" in groups, "inertial" in groups
        self._with_odometry = "odometry" in groups
        self._rig = rig_of(cameras) if "camera" in groups else None
        self._lidar_config = lidar_of(lidar) if "lidar" in groups else None
        self._half_sweeps = half_sweeps
        self.weather = weather or "ClearNoon"
        self._ego, self._town = ego, town
        self._prompt: Prompt | None = None
        self._stop_lines = stop_lines_of(town.signals)
        self._chunks = build_map_chunks(town.lanes)
        self._geo_origin = np.array(town.geo_origin, np.float64)

    def of_ego(self, ego: int) -> Observer:
        """Another observer, of that ego: it shares the static tables, `start` makes its buffers."""
        other = copy.copy(self)
        other._ego = ego
        other._prompt = None
        return other

    def write_prompt_to(self, prompt: Prompt) -> None:
        """Makes `prompt` the buffer, from the next `start` on; a row of many worlds', say."""
        self._prompt = prompt

    def start(self, view: WorldView) -> None:
        """Takes up an episode: the view's state arrays and the ego's plan."""
        self._sight = Sight(
            state=view.state,
            route=prompt_route_of(view.plans[self._ego]),
            stop_lines=self._stop_lines,
            lanes=self._town.lanes,
            chunks=self._chunks,
            geo_origin=self._geo_origin,
            prompt=empty_prompt() if self._prompt is None else self._prompt,
            imu=np.zeros(7, np.float32),
            gnss=np.zeros(3, np.float64),
        )
        self._fill = bind(
            fill_observation, self._sight, self._ego, self._with_prompt, self._with_inertial
        )
        self._cameras: CameraRig | None = None
        if self._rig is not None:
            weather = weather_of(self.weather)
            self._cameras = CameraRig(self._town, self._rig, weather, self._ego)
            self._cameras.start(view)
        self._lidar: Lidar | None = None
        if self._lidar_config is not None:
            self._lidar = Lidar(
                self._town, self._lidar_config, self._ego, half_sweeps=self._half_sweeps
            )
            self._lidar.start(view)

    def change_weather(self, weather: str) -> None:
        """What cameras see from now on; for much less than another `start`."""
        self.weather = weather
        if self._cameras is not None:
            self._cameras.change_weather(weather_of(weather))

    def front(self) -> dict[str, Any]:
        """What a view for people shows of the observation: the front camera, if there is one."""
        return {} if self._cameras is None else self._cameras.observe(only="camera_front")

    def observe(self) -> dict[str, Any]:
        """The present observation; every array is a fresh one."""
        observation: dict[str, Any] = {}
        self.write_tables()
        if self._with_prompt:
            observation.update(prompt_observation(self._sight.prompt))
            observation["command"] = observation["command"][0]
        observation.update(self.measure())
        return observation

    def write_tables(self) -> None:
        """Writes the prompt and the inertial sensors to their buffers: the first part of a look."""
        self._fill(self._sight, self._ego, self._with_prompt, self._with_inertial)

    def measure(self) -> dict[str, Any]:
        """What sensors see: the second part of a look, all of it but the prompt."""
        observation: dict[str, Any] = {}
        sight = self._sight
        if self._with_inertial:
            observation["imu"] = sight.imu.copy()
            observation["gnss"] = sight.gnss.copy()
            if not self._with_prompt:
                speed_mps = float(sight.state.speed[self._ego])
                speed_mps = min(max(speed_mps, -SPEED_LIMIT_MPS), SPEED_LIMIT_MPS)
                observation["speed"] = np.array([speed_mps], np.float32)
        if self._with_odometry:
            observation["odometry"] = _odometry(sight.state, sight.route, self._ego)
        if self._cameras is not None:
            observation.update(self._cameras.observe())
        if self._lidar is not None:
            observation.update(self._lidar.observe())
        return observation


def _odometry(state: State, route: PromptRoute, ego: int) -> NDArray[np.float32]:
    """(3,) x, y [m], yaw [rad] of an ego in the frame of its route's first point."""
    x, y, _, yaw = route.points[0].tolist()
    dx, dy = float(state.x[ego]) - x, float(state.y[ego]) - y
    cos, sin = math.cos(yaw), math.sin(yaw)
    turn = math.remainder(float(state.yaw[ego]) - yaw, 2.0 * math.pi)
    place = np.clip([cos * dx + sin * dy, cos * dy - sin * dx], -ODOMETRY_LIMIT_M, ODOMETRY_LIMIT_M)
    return np.array([*place, min(max(turn, -_PI), _PI)], np.float32)
