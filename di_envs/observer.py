"""Who looks at a world through an ego's eyes: the observer, which fills the observation space."""

from __future__ import annotations

import copy
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.config import ROUTE_WEATHER
from di_envs.numerics.arrays import Float32, Float64
from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import bind, kernel
from di_envs.observation import ODOMETRY_LIMIT_M, PI
from di_envs.prompt import (
    COMPONENTS,
    SPEED_LIMIT_MPS,
    Prompt,
    PromptRoute,
    StopLines,
    empty_prompt,
    prompt_route_of,
    stop_lines_of,
)
from di_envs.prompt_filling import fill_prompt
from di_envs.sensors.camera.cameras import CameraRig
from di_envs.sensors.camera.config import Rig, rig_of
from di_envs.sensors.inertial import fill_gnss, fill_imu
from di_envs.sensors.lidar.config import LidarConfig, lidar_of
from di_envs.sensors.lidar.sweep import Lidar
from di_envs.sensors.proximity import proximity_of
from di_envs.sensors.radar.config import FRONT_RADAR, RadarConfig
from di_envs.sensors.radar.look import Radars
from di_envs.sensors.route_weather import keyframes_of, weather_at
from di_envs.sensors.weather import Weather, weather_of
from di_envs.town.lanes import Lanes
from di_envs.town.map_chunks import MapChunks, map_chunks_of
from di_envs.town.town import Town
from di_envs.world.state import State
from di_envs.world.world import WorldView


@by_reference
class ObservationParts(NamedTuple):
    """All that one look at the world reads and writes: one argument, as each costs time."""

    state: State
    route: PromptRoute
    stop_lines: StopLines
    lanes: Lanes
    chunks: MapChunks
    geo_origin: Float64  # (2,) latitude, longitude [deg]
    prompt: Prompt  # written, as are the rest
    imu: Float32  # (7,)
    gnss: Float64  # (3,)


@kernel
def fill_observation(
    sight: ObservationParts, ego: int, with_prompt: bool, with_inertial: bool
) -> None:
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
    """Looks at a world through one ego's eyes. Keeps no memory: only buffers and static tables,
    and which weather the cameras have been told, to tell them no more often than need be.

    Attributes:
        weather: What cameras see from the next `start` on: a preset, or that of the route's file.
        with_prompt: Whether it writes the prompt.
        with_inertial: Whether it writes the inertial sensors.
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
        radars: tuple[RadarConfig, ...] = FRONT_RADAR,
        gnss_origin: tuple[float, float] | None = None,
    ) -> None:
        """Prepares to look.

        Args:
            town: The town.
            groups: Groups of observations.
            ego: Index of the ego that looks.
            cameras: Its rig, or the name of a shipped one; for group `camera`.
            lidar: Its LiDAR, or the name of a shipped one; for group `lidar`.
            half_sweeps: It looks at every tick, so it sees half a turn of the LiDAR each time.
            weather: What cameras see, one of CARLA's presets, or `route` for what the route's file
                says; None for ClearNoon.
            radars: Its radars; for group `radar`.
            gnss_origin: Latitude and longitude [deg] of x = y = 0; None for the town's.
        """
        self.with_prompt, self.with_inertial = "prompt" in groups, "inertial" in groups
        self._with_odometry = "odometry" in groups
        self._rig = rig_of(cameras) if "camera" in groups else None
        self._lidar_config = lidar_of(lidar) if "lidar" in groups else None
        self._radar_configs = radars if "radar" in groups else ()
        self._with_proximity = "proximity" in groups
        self._half_sweeps = half_sweeps
        self.weather = weather or "ClearNoon"
        self._ego, self._town = ego, town
        self._prompt: Prompt | None = None
        self._stop_lines = stop_lines_of(town.signals)
        self._chunks = map_chunks_of(town)
        self._geo_origin = np.array(gnss_origin or town.geo_origin, np.float64)

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
        self._sight = ObservationParts(
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
            fill_observation, self._sight, self._ego, self.with_prompt, self.with_inertial
        )
        self._cameras: CameraRig | None = None
        if self._rig is not None:
            self._plan = view.plans[self._ego]
            self._frames = keyframes_of(self._plan.weathers)
            self._cameras = CameraRig(self._town, self._rig, self._weather_now(), self._ego)
            self._cameras.start(view)
        self._lidar: Lidar | None = None
        if self._lidar_config is not None:
            self._lidar = Lidar(
                self._town, self._lidar_config, self._ego, half_sweeps=self._half_sweeps
            )
            self._lidar.start(view)
        self._radars: Radars | None = None
        if self._radar_configs:
            self._radars = Radars(self._town, self._radar_configs, self._ego)
            self._radars.start(view)

    @property
    def sight(self) -> ObservationParts:
        """What its kernel reads and writes: another one after each `start`."""
        return self._sight

    def change_weather(self, weather: str) -> None:
        """What cameras see from now on; for much less than another `start`."""
        self.weather = weather
        if self._cameras is not None:
            self._cameras.change_weather(self._weather_now())

    def _weather_now(self) -> Weather:
        """What cameras see at the ego's point of its route, which it also notes."""
        self._weather_point = int(self._sight.state.route_index[self._ego])
        if self.weather != ROUTE_WEATHER:
            return weather_of(self.weather)
        done_m = float(self._plan.route_m[self._weather_point])
        return weather_at(self._frames, 100.0 * done_m / self._plan.length_m)

    def _follow_weather(self, cameras: CameraRig) -> None:
        """Shows the weather of where the ego has come to, if that is another."""
        if self.weather != ROUTE_WEATHER or len(self._frames) == 1:
            return
        if int(self._sight.state.route_index[self._ego]) != self._weather_point:
            cameras.change_weather(self._weather_now())

    def front(self) -> dict[str, Any]:
        """What a view for people shows of the observation: the front camera, if there is one."""
        if self._cameras is None:
            return {}
        self._follow_weather(self._cameras)
        return self._cameras.observe(only="camera_front")

    def observe(self) -> dict[str, Any]:
        """The present observation; every array is a fresh one."""
        observation: dict[str, Any] = {}
        self.write_tables()
        if self.with_prompt:
            observation.update(prompt_observation(self._sight.prompt))
            observation["command"] = observation["command"][0]
        observation.update(self.measure())
        return observation

    def write_tables(self) -> None:
        """Writes the prompt and the inertial sensors to their buffers: the first part of a look."""
        self._fill(self._sight, self._ego, self.with_prompt, self.with_inertial)

    def measure(self) -> dict[str, Any]:
        """What sensors see: the second part of a look, all of it but the prompt."""
        observation: dict[str, Any] = {}
        sight = self._sight
        if self.with_inertial:
            observation["imu"] = sight.imu.copy()
            observation["gnss"] = sight.gnss.copy()
            if not self.with_prompt:
                speed_mps = float(sight.state.speed[self._ego])
                speed_mps = min(max(speed_mps, -SPEED_LIMIT_MPS), SPEED_LIMIT_MPS)
                observation["speed"] = np.array([speed_mps], np.float32)
        if self._with_odometry:
            observation["odometry"] = odometry_of(sight.state, sight.route, self._ego)
        if self._cameras is not None:
            self._follow_weather(self._cameras)
            observation.update(self._cameras.observe())
        if self._lidar is not None:
            observation.update(self._lidar.observe())
        if self._radars is not None:
            observation.update(self._radars.observe())
        if self._with_proximity:
            observation.update(proximity_of(sight.state, sight.lanes, self._ego))
        return observation


def odometry_of(state: State, route: PromptRoute, ego: int) -> Float32:
    """(3,) x, y [m], yaw [rad] of an ego in the frame of its route's first point."""
    x, y, _, yaw = route.points[0].tolist()
    dx, dy = float(state.x[ego]) - x, float(state.y[ego]) - y
    cos, sin = math.cos(yaw), math.sin(yaw)
    turn = math.remainder(float(state.yaw[ego]) - yaw, 2.0 * math.pi)
    place = np.clip([cos * dx + sin * dy, cos * dy - sin * dx], -ODOMETRY_LIMIT_M, ODOMETRY_LIMIT_M)
    return np.array([*place, min(max(turn, -PI), PI)], np.float32)
