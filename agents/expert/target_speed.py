"""How fast to drive a path with nobody in the way: limits, corners, places to be wary at."""

from __future__ import annotations

import numpy as np

from agents.expert.base_line import STEP_M, LaidLeg, Points
from agents.expert.config import ExpertConfig
from di_envs.numerics.arrays import Float64
from di_envs.town.lanes import Lanes
from di_envs.town.plan import RoutePlan

WARY_BEFORE_M, WARY_BEHIND_M = 3.0, 17.0  # of a trigger of scenario 3, where somebody may step out
STEPS_OUT = 3  # its number


def target_speeds(
    plan: RoutePlan,
    points: Points,
    curvature: Float64,
    legs: list[LaidLeg],
    lanes: Lanes,
    config: ExpertConfig,
) -> Float64:
    """Speed limit, cornering and wary speed, lowered where braking for what comes needs it.

    Args:
        plan: The route, with its scenarios.
        points: (P,) of the path, at even stations.
        curvature: (P,) of the path [1/m].
        legs: On the path, in order.
        lanes: The town's lanes.
        config: Speeds and accelerations.

    Returns:
        (P,) speeds [m/s].
    """
    begins = np.array([leg.begin_m for leg in legs])
    lane_of_leg = np.array([leg.lane for leg in legs])
    leg = np.clip(np.searchsorted(begins, points.station_m, side="right") - 1, 0, len(legs) - 1)
    limit = lanes.speed_limit_mps[lane_of_leg[leg]] * config.limit_factor
    corner = np.sqrt(config.lateral_mps2 / np.maximum(np.abs(curvature), 1e-4))
    speed = np.minimum(np.minimum(limit, corner), _wary_speeds(plan, points, config))
    for i in range(speed.size - 2, -1, -1):
        reachable = np.sqrt(speed[i + 1] ** 2 + 2.0 * config.corner_braking_mps2 * STEP_M)
        speed[i] = min(speed[i], reachable)
    return speed


def _wary_speeds(plan: RoutePlan, points: Points, config: ExpertConfig) -> Float64:
    """Speeds (P,) where the plan says that somebody hides beside the road; else infinite."""
    speed = np.full(points.x.size, np.inf)
    past = 0
    for trigger in plan.scenarios:
        if trigger.type != STEPS_OUT:
            continue
        x, y, z, yaw = plan.points[trigger.point]
        away = (points.x - x) ** 2 + (points.y - y) ** 2 + (points.z - z) ** 2
        away[np.cos(points.yaw - yaw) < 0.5] = np.inf  # the path may cross itself there
        past += int(np.argmin(away[past:]))
        begin = max(past - int(WARY_BEFORE_M / STEP_M), 0)
        speed[begin : past + int(WARY_BEHIND_M / STEP_M)] = config.wary_mps
    return speed
