"""Where the expert drove, as the waypoints that a policy is to predict."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agents.training.frames import RecordedDrive


def expert_waypoints(
    drive: RecordedDrive, moment: int, count: int, pose: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Where the expert was afterwards.

    Args:
        drive: The drive.
        moment: The present one.
        count: Number of waypoints, at the drive's own 0.5 s.
        pose: (3,) x, y, yaw of the ego, wherever it was set.

    Returns:
        (count, 2) x ahead, y right of `pose` [m], and (count,) 1 where the drive goes on so long.
    """
    future = drive.future(moment)[:count] - pose[:2]
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    waypoints, valid = np.zeros((count, 2), np.float32), np.zeros(count, np.float32)
    known = len(future)
    waypoints[:known, 0] = cos * future[:, 0] + sin * future[:, 1]
    waypoints[:known, 1] = cos * future[:, 1] - sin * future[:, 0]
    valid[:known] = 1.0
    return waypoints, valid
