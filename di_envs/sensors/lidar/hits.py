"""Whom the rays of a sweep hit, and at which angle: what a semantic LiDAR tells besides tags."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.sensors.lidar.rays import GROUND, NONE, Sweep


def hits_of(sweep: Sweep, ego: int, points: NDArray[np.float32]) -> dict[str, NDArray[Any]]:
    """Actors and angles of incidence of a sweep that was taken.

    Args:
        sweep: Its hits are known.
        ego: The ego that carries the LiDAR.
        points: (rays, 4) as the sweep wrote them, in the ego's frame.

    Returns:
        `lidar_instance` and `lidar_incidence`, as `LidarConfig` has them.
    """
    first, end = sweep.scan.tolist()
    hit = sweep.hit[first:end].reshape(-1)
    boxes = sweep.boxes
    instance = np.where(hit >= 0, boxes.instance[np.maximum(hit, 0)], 0).astype(np.int32)
    incidence = np.zeros(len(hit), np.float32)
    sines = np.tile(np.abs(sweep.sine), end - first)
    incidence[hit == GROUND] = sines[hit == GROUND]
    rays = np.flatnonzero((hit != NONE) & (hit != GROUND))
    incidence[rays] = _on_boxes(sweep, ego, hit[rays], points[rays, :3].astype(np.float64))
    return {"lidar_instance": instance, "lidar_incidence": incidence}


def _on_boxes(
    sweep: Sweep, ego: int, box: NDArray[np.int32], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N,) cosines of the angles at which rays met the faces of boxes, by where they ended."""
    state, boxes = sweep.state, sweep.boxes
    mount = np.array([sweep.x_m, sweep.y_m, sweep.z_m])
    way = points - mount
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    c, s = np.cos(state.yaw[ego]), np.sin(state.yaw[ego])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    place = np.array([state.x[ego], state.y[ego], state.z[ego]])
    off = _along_axes(boxes.yaw[box], boxes.pitch[box], points @ turn.T + place - boxes.centre[box])
    ray = _along_axes(boxes.yaw[box], boxes.pitch[box], way @ turn.T)
    depth_m = np.abs(np.abs(off) - boxes.half[box])  # of the point below each pair of faces
    face = depth_m.argmin(axis=1)
    return np.minimum(np.abs(np.take_along_axis(ray, face[:, None], axis=1)[:, 0]), 1.0)


def _along_axes(
    yaw: NDArray[np.float32], pitch: NDArray[np.float32], vectors: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, 3) parts of vectors of the world frame along boxes' own axes."""
    c, s, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    ahead = c * vectors[:, 0] + s * vectors[:, 1]
    right = c * vectors[:, 1] - s * vectors[:, 0]
    up = vectors[:, 2]
    return np.stack([cp * ahead + sp * up, right, cp * up - sp * ahead], axis=1)
