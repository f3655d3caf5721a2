"""Steering along the path, as a kernel.

It inverts the ego's own model (`di_envs.world.dynamics`), so little is left to feedback.
"""

from __future__ import annotations

import math

from agents.expert.base_line import STEP_M
from agents.expert.path import DrivePath
from agents.expert.progress import Progress, pose_at, project
from di_envs.numerics.geometry import wrap_angle
from di_envs.numerics.kernels import kernel
from di_envs.world.dynamics import EgoParameters

SHORTEST_LENGTH_M = 2.0  # over which an offset from the path is driven back, at walking pace
LENGTH_TIME_S = 0.4  # and per m/s of speed
LEAD_S = 0.15  # from a decision to the wheel: the actuator's lag and half a decision


@kernel
def steering(
    path: DrivePath,
    progress: Progress,
    x: float,
    y: float,
    yaw: float,
    speed: float,
    model: EgoParameters,
) -> float:
    """Wheel position -1..1 that leads the car back onto the path and along it.

    The point that the model never moves sideways, `rear_axle_m` behind the centre, obeys
    curvature = path's - offset / length² - 2 x heading error / length: critically damped over a
    length. The path's curvature is read ahead by the time that the wheel takes.
    """
    rear_x = x - model.rear_axle_m * math.cos(yaw)
    rear_y = y - model.rear_axle_m * math.sin(yaw)
    index = int(progress.station_m / STEP_M)
    begin = max(index - 16, 0)
    end = min(index + 16, path.x.size)
    station, offset, path_yaw = project(path, progress, rear_x, rear_y, begin, end)
    _, _, _, curvature = pose_at(path, progress, station + LEAD_S * speed)
    length = max(SHORTEST_LENGTH_M, LENGTH_TIME_S * speed)
    turn = min(max(wrap_angle(yaw - path_yaw), -1.2), 1.2)
    drift = min(max(offset / length, -1.0), 1.0)
    wanted = curvature - drift / length - 2.0 * math.sin(turn) / length
    wheelbase = model.front_axle_m + model.rear_axle_m
    return min(max(math.atan(wanted * wheelbase) / model.steer_gain_rad, -1.0), 1.0)
