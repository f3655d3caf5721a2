"""The Leaderboard's LiDAR as the one that a policy was trained with.

CARLA's hands out half a turn in each tick, ten times as dense as ours: of each half those rays are
kept that point as one of the policy's own does, and the half of the tick before is brought to where
the car is now.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from agents.carla.exported.sensors import FULL
from di_envs.sensors.lidar.config import LidarConfig

Pose = tuple[float, float, float]  # x, y [m], yaw [rad] in a frame that stays


def thinned(points: NDArray[np.float32], lidar: LidarConfig) -> NDArray[np.float32]:
    """The points that lie on a policy's own rays, to half of what lies between two of CARLA's.

    Args:
        points: (N, 4) x, y, z [m] and intensity in the sensor's level frame.
        lidar: The policy's.

    Returns:
        (rays, 4) in the ego's frame, a row for each of its rays, zeros where nothing came back.
    """
    x, y, z = points[:, :3].astype(np.float64).T
    elevation = np.degrees(np.arctan2(z, np.hypot(x, y)))
    azimuth = np.degrees(np.arctan2(y, x)) % 360.0
    apart = (lidar.upper_deg - lidar.lower_deg) / (lidar.channels - 1)
    channel = (lidar.upper_deg - elevation) / apart
    step = azimuth * lidar.steps / 360.0
    near = np.abs(channel - np.rint(channel)) * apart
    near_full = 0.5 * (FULL.upper_deg - FULL.lower_deg) / (FULL.channels - 1)
    aside = np.abs(step - np.rint(step)) * 360.0 / lidar.steps
    kept = (near <= near_full) & (aside <= 0.5 * 360.0 / FULL.steps)
    kept &= (np.rint(channel) >= 0) & (np.rint(channel) < lidar.channels)
    row = (np.rint(step) % lidar.steps * lidar.channels + np.rint(channel))[kept].astype(np.int64)
    found = np.zeros((lidar.rays, 4), np.float32)
    found[row] = points[kept] + np.array([lidar.x_m, lidar.y_m, lidar.z_m, 0.0], np.float32)
    return found


def whole_turn(
    half: NDArray[np.float32], before: NDArray[np.float32], then: Pose, now: Pose
) -> NDArray[np.float32]:
    """Two halves to a turn, as if both had been scanned now.

    Args:
        half: (rays, 4) of this tick, in the ego's frame.
        before: Of the tick before, in the ego's frame of then.
        then: Where the ego was.
        now: Where it is.

    Returns:
        (rays, 4); where both have a point, that of now.
    """
    turn = then[2] - now[2]
    c, s = math.cos(turn), math.sin(turn)
    dx, dy = then[0] - now[0], then[1] - now[1]
    ahead = math.cos(now[2]) * dx + math.sin(now[2]) * dy
    right = math.cos(now[2]) * dy - math.sin(now[2]) * dx
    moved = before.copy()
    there = before[:, 3] > 0.0
    x, y = before[there, 0], before[there, 1]
    moved[there, 0] = ahead + c * x - s * y
    moved[there, 1] = right + s * x + c * y
    return np.where((half[:, 3] > 0.0)[:, None], half, moved)
