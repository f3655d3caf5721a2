"""Radars: rays into a cone, each with how far it goes and how fast what it meets moves away.

Like CARLA's: the rays of a tick lie anywhere in an ellipse round the axis, drawn anew each tick;
those that meet nothing within range are not there. They see what cameras and LiDAR see.

Source: columns and the sign of velocities as of CARLA's `sensor.other.radar`. Our own code.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.arrays import Float32, Float64
from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import bind, kernel
from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.sensors.radar.config import MOST_RADARS, RadarConfig
from di_envs.sensors.scene.boxes import Boxes
from di_envs.sensors.scene.scene import Scene, box_buffer, collect_boxes, scene_of
from di_envs.town.town import Town
from di_envs.world.state import State
from di_envs.world.world import WorldView

_KEYS = 1 << 20  # draws kept apart for each radar of an ego
_RADAR = int(Stream.RADAR)
_NEAR_M = 0.2  # nothing nearer is met


@by_reference
class RadarParts(NamedTuple):
    """All that one look reads and writes: one argument, as each costs time."""

    state: State
    scene: Scene
    boxes: Boxes
    turn: Float64  # (3, 3) `ego_from_radar`
    place: Float64  # (3,) mounting in the ego's frame [m]
    range_m: float
    reach: float  # tangent of half the cone
    key: int  # which of the ego's radars


@kernel
def look(parts: RadarParts, ego: int, rows: Float32) -> None:
    """Takes a look.

    Args:
        parts: Its boxes were collected before.
        ego: The ego's index.
        rows: (N, 4) written: distance [m], azimuth to the right and elevation [rad] in the radar's
            frame, and speed away from it [m/s]; zeros for rays that met nothing.
    """
    state, turn = parts.state, parts.turn
    c, s = math.cos(state.yaw[ego]), math.sin(state.yaw[ego])
    start = (
        state.x[ego] + c * parts.place[0] - s * parts.place[1],
        state.y[ego] + s * parts.place[0] + c * parts.place[1],
        state.z[ego] + parts.place[2],
    )
    seed, tick = state.seed[()], state.tick[()]
    for ray in range(rows.shape[0]):
        key = ((ego * MOST_RADARS + parts.key) * _KEYS + ray) * 2
        out = parts.reach * uniform(seed, _RADAR, tick, key)
        angle = 2.0 * math.pi * uniform(seed, _RADAR, tick, key + 1)
        right, up = out * math.cos(angle), out * math.sin(angle)
        long = math.sqrt(1.0 + right * right + up * up)
        a, r, u = 1.0 / long, right / long, up / long
        ex = turn[0, 0] * a + turn[0, 1] * r + turn[0, 2] * u
        ey = turn[1, 0] * a + turn[1, 1] * r + turn[1, 2] * u
        ez = turn[2, 0] * a + turn[2, 1] * r + turn[2, 2] * u
        way = (c * ex - s * ey, s * ex + c * ey, ez)
        far, box = _first_met(parts, start, way)
        for k in range(4):
            rows[ray, k] = 0.0
        if far > parts.range_m:
            continue
        rows[ray, 0] = far
        rows[ray, 1] = math.atan2(right, 1.0)
        rows[ray, 2] = math.asin(u)
        rows[ray, 3] = _away(parts, ego, box, way)


@kernel
def _first_met(
    parts: RadarParts, start: tuple[float, float, float], way: tuple[float, float, float]
) -> tuple[float, int]:
    """How far a ray goes [m], and the box that it meets, -1 for the ground."""
    above = start[2] - parts.scene.base_z[0]
    best, met = 1e9, -1
    if above > 0.0 and way[2] < -1e-9:
        best = -above / way[2]
    boxes = parts.boxes
    for box in range(boxes.count[0]):
        far = _into_box(boxes, box, start, way)
        if far < best:
            best, met = far, box
    return best, met


@kernel
def _into_box(
    boxes: Boxes, box: int, start: tuple[float, float, float], way: tuple[float, float, float]
) -> float:
    """How far it is to a box along a ray [m]; 1e9 where the ray misses it or starts inside."""
    yaw, pitch = np.float64(boxes.yaw[box]), np.float64(boxes.pitch[box])
    c, s, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    dx, dy = start[0] - boxes.centre[box, 0], start[1] - boxes.centre[box, 1]
    dz = start[2] - boxes.centre[box, 2]
    ahead, along = c * dx + s * dy, c * way[0] + s * way[1]
    origin = (cp * ahead + sp * dz, c * dy - s * dx, cp * dz - sp * ahead)
    ray = (cp * along + sp * way[2], c * way[1] - s * way[0], cp * way[2] - sp * along)
    enter, leave = -1e9, 1e9
    for axis in range(3):
        half = np.float64(boxes.half[box, axis])
        if abs(ray[axis]) < 1e-12:
            if abs(origin[axis]) > half:
                return 1e9
            continue
        one, two = (-half - origin[axis]) / ray[axis], (half - origin[axis]) / ray[axis]
        enter, leave = max(enter, min(one, two)), min(leave, max(one, two))
    return enter if _NEAR_M < enter <= leave else 1e9


@kernel
def _away(parts: RadarParts, ego: int, box: int, way: tuple[float, float, float]) -> float:
    """How fast a box, -1 for the ground, moves away from the ego along a ray [m/s]."""
    state = parts.state
    vx = -state.speed[ego] * math.cos(state.yaw[ego])
    vy = -state.speed[ego] * math.sin(state.yaw[ego])
    if box >= 0 and parts.boxes.instance[box] > 0:
        actor = parts.boxes.instance[box] - 1
        vx += state.speed[actor] * math.cos(state.yaw[actor])
        vy += state.speed[actor] * math.sin(state.yaw[actor])
    return vx * way[0] + vy * way[1]


class Radars:
    """Some radars on an ego. Keeps no memory: only buffers and static tables."""

    def __init__(self, town: Town, configs: tuple[RadarConfig, ...], ego: int = 0) -> None:
        """Builds the town's scene, unless that was done before."""
        self._configs, self._ego, self._scene = configs, ego, scene_of(town)
        self._range_m = max(
            config.range_m + math.hypot(config.x_m, config.y_m) for config in configs
        )

    def start(self, view: WorldView) -> None:
        """Takes up an episode: the view's state arrays."""
        self._state, self._boxes = view.state, box_buffer()
        self._collect = bind(
            collect_boxes, self._scene, view.state, self._ego, self._range_m, self._boxes
        )
        self._parts = [self._parts_of(number) for number in range(len(self._configs))]
        self._look = bind(look, self._parts[0], self._ego, self._rows(self._configs[0]))

    def observe(self) -> dict[str, NDArray[Any]]:
        """What the radars meet now, by name; every array is a fresh one."""
        self._collect(self._scene, self._state, self._ego, self._range_m, self._boxes)
        found: dict[str, NDArray[Any]] = {}
        for config, parts in zip(self._configs, self._parts, strict=True):
            rows = self._rows(config)
            self._look(parts, self._ego, rows)
            found[config.name] = rows
        return found

    def _rows(self, config: RadarConfig) -> NDArray[np.float32]:
        return np.zeros((config.rays, 4), np.float32)

    def _parts_of(self, number: int) -> RadarParts:
        config = self._configs[number]
        return RadarParts(
            state=self._state,
            scene=self._scene,
            boxes=self._boxes,
            turn=config.ego_from_radar(),
            place=np.array([config.x_m, config.y_m, config.z_m], np.float64),
            range_m=float(config.range_m),
            reach=math.tan(math.radians(config.fov_deg) / 2.0),
            key=number,
        )
