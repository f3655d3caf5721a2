"""LiDAR: a sweep of rays against the same scene that cameras show.

A LiDAR turns ten times a second. An observer that looks at every world tick, twice a turn, gets
just the half that was scanned in it: the first half of the steps (ahead, to the right, behind) at
odd ticks, the second at even ones. Both have `(steps + 1) // 2` steps, so where a sweep's number is
odd both hold the one in the middle. An observer that looks less often gets whole sweeps.

`docs/conventions.md` has the frames; `rays.py` the rays, `points.py` what is made of them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.arrays import Float32, UInt8
from di_envs.numerics.kernels import bind, kernel
from di_envs.sensors.lidar.config import LidarConfig
from di_envs.sensors.lidar.hits import hits_of
from di_envs.sensors.lidar.points import write_points, write_tags
from di_envs.sensors.lidar.rays import Sweep, meet_boxes, meet_ground
from di_envs.sensors.lidar.window import LidarPose
from di_envs.sensors.scene.scene import Scene, box_buffer, collect_boxes, scene_of
from di_envs.town.town import Town
from di_envs.world.state import State
from di_envs.world.world import WorldView


@kernel
def sweep_rays(sweep: Sweep, ego: int, points: Float32, tags: UInt8) -> None:
    """Takes a sweep.

    Args:
        sweep: Its boxes were collected before.
        ego: The ego's index.
        points: (K, C, 4) written: x, y, z [m] in the ego's frame and intensity, or zeros. K is the
            number of steps, or that of `half_steps`: then of the half that this tick scans.
        tags: (K, C) written: `Tag`; or (0, C) where it is not asked for.
    """
    state = sweep.state
    c, s = math.cos(state.yaw[ego]), math.sin(state.yaw[ego])
    pose = LidarPose(
        state.x[ego] + c * sweep.x_m - s * sweep.y_m,
        state.y[ego] + s * sweep.x_m + c * sweep.y_m,
        state.z[ego] + sweep.z_m,
        state.yaw[ego],
    )
    scan = points.shape[0]
    sweep.scan[0] = sweep.turn.shape[0] - scan if sweep.state.tick[()] % 2 == 0 else 0
    sweep.scan[1] = sweep.scan[0] + scan
    meet_ground(sweep, pose.z - sweep.scene.base_z[0])
    meet_boxes(sweep, pose)
    write_points(sweep, ego, points)
    if tags.shape[0] > 0:
        write_tags(sweep, pose, tags)


class Lidar:
    """A LiDAR on an ego. Keeps no memory: only buffers and static tables."""

    def __init__(
        self, town: Town, config: LidarConfig, ego: int = 0, *, half_sweeps: bool = False
    ) -> None:
        """Builds the town's scene, unless that was done before.

        Args:
            town: The town.
            config: Its rays and mounting.
            ego: Index of the ego that carries it.
            half_sweeps: Hand out the half that each tick scans, not whole sweeps.
        """
        self.config = config
        self._ego = ego
        self._scene = scene_of(town)
        self._range_m = config.reach_m
        self._steps = config.half_steps if half_sweeps else config.steps

    def start(self, view: WorldView) -> None:
        """Takes up an episode: the view's state arrays."""
        self._sweep = _sweep(self.config, view.state, self._scene)
        boxes = self._sweep.boxes
        self._collect = bind(
            collect_boxes, self._scene, view.state, self._ego, self._range_m, boxes
        )
        self._rays = bind(sweep_rays, self._sweep, self._ego, *self._images())

    def observe(self) -> dict[str, NDArray[Any]]:
        """The present sweep, `lidar` and what else was asked for; every array is a fresh one."""
        sweep, rays = self._sweep, self._steps * self.config.channels
        self._collect(self._scene, sweep.state, self._ego, self._range_m, sweep.boxes)
        points, tags = self._images()
        self._rays(sweep, self._ego, points, tags)
        found: dict[str, NDArray[Any]] = {"lidar": points.reshape(rays, 4)}
        if self.config.semantic:
            found["lidar_semantic"] = tags.reshape(rays)
        if self.config.instance:
            found |= hits_of(sweep, self._ego, points.reshape(rays, 4))
        return found

    def _images(self) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        steps, channels = self._steps, self.config.channels
        tags = np.zeros((steps if self.config.semantic else 0, channels), np.uint8)
        return np.zeros((steps, channels, 4), np.float32), tags


def _sweep(config: LidarConfig, state: State, scene: Scene) -> Sweep:
    elevation = np.radians(np.linspace(config.upper_deg, config.lower_deg, config.channels))
    elevation = np.where(np.abs(elevation) < 1e-7, -1e-7, elevation)  # level, but no 0 / 0
    azimuth = 2.0 * np.pi * np.arange(config.steps) / config.steps
    size = (config.steps, config.channels)
    return Sweep(
        state=state,
        scene=scene,
        boxes=box_buffer(),
        x_m=float(config.x_m),
        y_m=float(config.y_m),
        z_m=float(config.z_m),
        range_m=float(config.range_m),
        attenuation_per_m=float(config.attenuation_per_m),
        dropoff=float(config.dropoff),
        dropoff_intensity=float(config.dropoff_intensity),
        dropoff_zero=float(config.dropoff_zero),
        noise_m=float(config.noise_m),
        tangent=np.tan(elevation),
        sine=np.sin(elevation).astype(np.float32),
        cosine=np.cos(elevation).astype(np.float32),
        over_sine=(1.0 / np.sin(elevation)).astype(np.float32),
        over_cosine=(1.0 / np.cos(elevation)).astype(np.float32),
        scan=np.zeros(2, np.int64),
        turn=np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1).astype(np.float32),
        distance=np.zeros(size, np.float32),
        hit=np.zeros(size, np.int32),
    )
