"""What a driver sees: the observation space by groups, and the observer that fills it.

The space is one flat Dict of fixed shapes, padded with a validity column. Ego frame: metres, x
ahead, y right, yaw clockwise relative to the ego's; coordinates are clipped to ±100 m.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from di_envs.map_chunks import POINTS, MapKind, build_map_chunks
from di_envs.prompt import (
    COMPONENTS,
    LIGHTS,
    MAP_POLYLINES,
    OBSTACLES,
    POSITION_LIMIT_M,
    ROUTING_POINTS,
    SPEED_LIMIT_MPS,
    STOP_SIGNS,
    empty_prompt,
    fill_prompt,
    prompt_route_of,
    stop_lines_of,
)
from di_envs.sensors.inertial import IMU_LIMIT, fill_gnss, fill_imu
from di_envs.town.lanes import LightState
from di_envs.town.plan import RoadOption
from di_envs.town.town import Town
from di_envs.world.state import SPEED_HISTORY, ActorKind
from di_envs.world.world import WorldView

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
}


def observation_space(groups: tuple[str, ...]) -> spaces.Dict:
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
    (latitude, longitude [deg], altitude [m]; double precision, as a single one is 0.4 m coarse).
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
    return spaces.Dict(space)


def _table(name: str) -> spaces.Box:
    leading, columns = _COLUMNS[name]
    low, high = np.array(columns, np.float32).T
    shape = (*leading, len(columns))
    return spaces.Box(np.broadcast_to(low, shape), np.broadcast_to(high, shape), dtype=np.float32)


class Observer:
    """Looks at a world through one ego's eyes. Keeps no memory: only buffers and static tables."""

    def __init__(self, town: Town, groups: tuple[str, ...], ego: int = 0) -> None:
        self._groups = groups
        self._ego = ego
        self._geo_origin = town.geo_origin
        self._prompt = empty_prompt()
        self._imu = np.zeros(7, np.float32)
        self._gnss = np.zeros(3, np.float64)
        if "prompt" in groups:
            self._stop_lines = stop_lines_of(town.signals)
            self._chunks = build_map_chunks(town.lanes)

    def start(self, view: WorldView) -> None:
        """Takes up an episode: the view's state arrays and the ego's plan."""
        self._state = view.state
        self._route = prompt_route_of(view.plans[self._ego])

    def observe(self) -> dict[str, Any]:
        """The present observation; every array is a fresh one."""
        observation: dict[str, Any] = {}
        if "prompt" in self._groups:
            out = self._prompt
            fill_prompt(self._state, self._route, self._stop_lines, self._chunks, self._ego, out)
            observation["command"] = out.command[0]
            for name in COMPONENTS[1:]:
                observation[name] = getattr(out, name).copy()
            observation["prompt_present"] = np.ones(len(COMPONENTS), np.int8)
        if "inertial" in self._groups:
            fill_imu(self._state, self._ego, self._imu)
            fill_gnss(self._state, self._ego, *self._geo_origin, self._gnss)
            observation["imu"] = self._imu.copy()
            observation["gnss"] = self._gnss.copy()
        return observation
