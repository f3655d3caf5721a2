"""How fast to drive a path with nobody in the way: limits, corners, places to be wary at."""

from __future__ import annotations

import math

import numpy as np

from agents.expert.base_line import STEP_M, LaidLeg, Points
from agents.expert.config import ExpertConfig
from di_envs.numerics.arrays import Float64
from di_envs.town.lanes import LaneKind, Lanes
from di_envs.town.plan import RoutePlan
from di_envs.town.queries import nearest_lane, width_at
from di_envs.world.dynamics import EgoModel

WARY_BEFORE_M, WARY_BEHIND_M = 3.0, 17.0  # of a trigger of scenario 3, where somebody may step out
STEPS_OUT = 3  # its number
WALKWAY_LOOK_M = 9.0  # to the side, for walkways
REACTION_S = 0.2  # until a decision and the brake act
STOPPING_MPS2 = 5.0  # with which the car stops for who steps off a walkway
_SIDEWALK_MASK = 1 << int(LaneKind.SIDEWALK)


def target_speeds(
    plan: RoutePlan,
    points: Points,
    curvature: Float64,
    legs: list[LaidLeg],
    lanes: Lanes,
    config: ExpertConfig,
    told: bool,
) -> Float64:
    """Speed limit, cornering and wary speed, lowered where braking for what comes needs it.

    Args:
        plan: The route, with its scenarios.
        points: (P,) of the path, at even stations.
        curvature: (P,) of the path [1/m].
        legs: On the path, in order.
        lanes: The town's lanes.
        config: Speeds and accelerations.
        told: Whether it knows where scenarios will begin; else it is wary of all walkways.

    Returns:
        (P,) speeds [m/s].
    """
    begins = np.array([leg.begin_m for leg in legs])
    lane_of_leg = np.array([leg.lane for leg in legs])
    leg = np.clip(np.searchsorted(begins, points.station_m, side="right") - 1, 0, len(legs) - 1)
    limit = lanes.speed_limit_mps[lane_of_leg[leg]] * config.limit_factor
    corner = np.sqrt(config.lateral_mps2 / np.maximum(np.abs(curvature), 1e-4))
    if told:
        wary = _wary_speeds(plan, points, config)
    else:
        wary = walkway_speeds(points, limit, lanes, config)
    speed = np.minimum(np.minimum(limit, corner), wary)
    for i in range(speed.size - 2, -1, -1):
        reachable = np.sqrt(speed[i + 1] ** 2 + 2.0 * config.corner_braking_mps2 * STEP_M)
        speed[i] = min(speed[i], reachable)
    return speed


def stopping_speed(room_m: float) -> float:
    """The speed [m/s] from which the car stops within some room, its reaction included."""
    lost = STOPPING_MPS2 * REACTION_S
    return math.sqrt(lost * lost + 2.0 * STOPPING_MPS2 * room_m) - lost


def walkway_speeds(points: Points, limit: Float64, lanes: Lanes, config: ExpertConfig) -> Float64:
    """Speeds (P,) beside walkways; infinite where none is near.

    Street furniture that no map shows may hide somebody on any walkway until he steps off it, let
    it be `kerb_sight_m` before the car. Where the car, at its limit (P,), would not be past him
    before he, at `runner_mps`, is in its way, it drives so that it stops within that.
    """
    cautious, half = stopping_speed(config.kerb_sight_m), EgoModel().half_width_m
    speed = np.full(points.x.size, np.inf)
    for i in range(points.x.size):
        edge_m = _to_walkway(points, i, lanes)
        runs_s = max(edge_m - half, 0.0) / config.runner_mps
        if edge_m < WALKWAY_LOOK_M and runs_s < config.kerb_sight_m / limit[i]:
            speed[i] = cautious
    return speed


def _to_walkway(points: Points, i: int, lanes: Lanes) -> float:
    """From a point of the path to the edge of the nearest walkway [m]."""
    x, y, z = float(points.x[i]), float(points.y[i]), float(points.z[i])
    found = nearest_lane(lanes, x, y, z, WALKWAY_LOOK_M, _SIDEWALK_MASK)
    if found.lane < 0:
        return WALKWAY_LOOK_M
    return float(found.distance_m) - 0.5 * float(width_at(lanes, int(found.lane), found.station_m))


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
