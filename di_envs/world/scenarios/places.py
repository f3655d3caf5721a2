"""Where a scenario's actors stand and which lights it plays with, from the town and the route.

Facts of the Leaderboard 1.0 (its scenario_runner, branch `leaderboard-1.0`, `object_crash_vehicle`,
`object_crash_intersection`, `control_loss`, `TrafficLightManipulator`): distances, offsets, the
order in which arms are looked for. Where CARLA goes along the lane, we go along the route.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from di_envs.numerics.geometry import wrap_angle
from di_envs.town.lanes import LaneKind, SignalKind
from di_envs.town.lanes_below import lanes_below_box
from di_envs.town.plan import RoutePlan
from di_envs.town.queries import (
    nearest_lane,
    pose_at,
    project_to_lane,
    width_at,
)
from di_envs.town.town import Town

Pose = tuple[float, float, float, float]  # x, y, z, yaw

BESIDE_M = 1.2  # beyond the edge of the last driving lane, where a parking lane is looked for
ABREAST_M = 0.3  # beyond its end a lane is further away than to the side
PARKING_WIDTH_M = 2.0  # a shoulder wider than this is one, as in CARLA
FAR_SIDE_M = 1.0  # beyond the last driving lane that somebody crosses
WIDEST_ROAD_M = 40.0
_PARKING_MASK = 1 << int(LaneKind.PARKING) | 1 << int(LaneKind.SHOULDER)

# Which other arm is green as well: the first of these that there is, by CARLA's subtype
ARMS: dict[str, tuple[str, ...]] = {
    "S7left": ("left", "opposite", "right"),
    "S7right": ("left", "opposite"),
    "S7opposite": ("right", "left", "opposite"),
    "S8left": ("opposite",),
    "S9right": ("left", "opposite"),
}
ARMS_BY_DEFAULT: dict[int, tuple[str, ...]] = {
    7: ARMS["S7left"],
    8: ARMS["S8left"],
    9: ARMS["S9right"],
}


@dataclass(frozen=True, kw_only=True)
class Kerb:
    """The right edge of a road: its last lane before the sidewalk, and what was passed."""

    lane: int  # the last driving lane
    station_m: float
    lanes: int  # driving lanes to the right of where one looked from
    parking: bool  # whether a parking lane follows
    edge_m: float  # from its centre to its right edge
    offset_m: float  # from the last driving lane's centre to that of the last lane, parking or not
    width_m: float  # of the last lane


def find_kerb(town: Town, lane: int, station_m: float) -> Kerb:
    """Goes right from a lane to the last one before the sidewalk."""
    lanes, passed = town.lanes, 0
    while lanes.right[lane] >= 0:
        x, y, _, _ = pose_at(lanes, lane, station_m)
        lane = int(lanes.right[lane])
        station_m = float(project_to_lane(lanes, lane, x, y)[0])
        passed += 1
    x, y, z, yaw = pose_at(lanes, lane, station_m)
    width = float(width_at(lanes, lane, station_m))
    aside = 0.5 * width + BESIDE_M
    at = x - aside * math.sin(yaw), y + aside * math.cos(yaw)
    beside, there, lateral, away = nearest_lane(lanes, at[0], at[1], z, BESIDE_M, _PARKING_MASK)
    if beside >= 0 and away - abs(lateral) < ABREAST_M:
        broad = float(width_at(lanes, beside, there))
        if broad > PARKING_WIDTH_M - 0.05 or lanes.kind[beside] == LaneKind.PARKING:
            offset = aside - float(lateral) * math.cos(pose_at(lanes, beside, there)[3] - yaw)
            return Kerb(
                lane=lane,
                station_m=station_m,
                lanes=passed,
                parking=True,
                edge_m=0.5 * width,
                offset_m=offset,
                width_m=broad,
            )
    return Kerb(
        lane=lane,
        station_m=station_m,
        lanes=passed,
        parking=False,
        edge_m=0.5 * width,
        offset_m=0.0,
        width_m=width,
    )


def beside_road(town: Town, kerb: Kerb) -> Pose:
    """Where somebody waits to cross: one lane's width right of the last lane, facing the road."""
    x, y, z, yaw = pose_at(town.lanes, kerb.lane, kerb.station_m)
    aside = kerb.offset_m + kerb.width_m
    return (
        x - aside * math.sin(yaw),
        y + aside * math.cos(yaw),
        z,
        float(wrap_angle(yaw - 0.5 * math.pi)),
    )


def crossing_length(town: Town, pose: Pose) -> float:
    """How far it is from a pose, straight ahead, to beyond the last driving lane [m]."""
    x, y, z, yaw = pose
    below = np.full(4, -1, np.int32)
    last = 0.0
    for step in range(1, int(WIDEST_ROAD_M / 0.5) + 1):
        m = 0.5 * step
        at_x, at_y = x + m * math.cos(yaw), y + m * math.sin(yaw)
        if lanes_below_box(town.lanes, at_x, at_y, z, yaw, 0.25, 0.25, below) > 0:
            last = m
        elif last > 0.0 and m > last + 6.0:  # a median is narrower
            break
    return last + FAR_SIDE_M


def point_after(plan: RoutePlan, point: int, distance_m: float, within: int) -> int:
    """The first route point at least so far behind another, `within` - 1 at the most."""
    found = int(np.searchsorted(plan.route_m, plan.route_m[point] + distance_m - 1e-9))
    return max(min(found, within - 1), point)


def next_junction(town: Town, plan: RoutePlan, point: int) -> tuple[int, int]:
    """Route points at which the first junction after a point begins and has ended.

    Both are the number of route points where there is none; a point inside one finds that one.
    """
    inside = town.lanes.junction[plan.lane[point:]] >= 0
    if not inside.any():
        return plan.lane.size, plan.lane.size
    begin = int(np.argmax(inside))
    after = ~inside[begin:]
    end = begin + int(np.argmax(after)) if after.any() else inside.size
    return point + begin, point + end


def road_pose(plan: RoutePlan, point: int) -> Pose:
    """Of the route at a point."""
    x, y, z, yaw = plan.points[point].tolist()
    return x, y, z, yaw


def lane_width(town: Town, plan: RoutePlan, point: int) -> float:
    """Of the route's lane at a point [m]."""
    return float(width_at(town.lanes, int(plan.lane[point]), float(plan.lane_m[point])))


def light_ahead(town: Town, plan: RoutePlan, begin: int) -> int:
    """The signal head of the light before the junction that begins at a route point; -1: none."""
    if begin < 1 or begin >= plan.lane.size:
        return -1
    line = int(town.lanes.stop_line[plan.lane[begin - 1]])
    if line < 0:
        return -1
    signal = int(town.signals.stop_signal[line])
    return signal if town.signals.kind[signal] == SignalKind.LIGHT else -1


def other_light(town: Town, signal: int, wanted: tuple[str, ...]) -> int:
    """The head of the first wanted arm that the junction has; -1 where it has none of them.

    An arm's name says where its traffic comes from, as seen by who faces `signal`.
    """
    signals = town.signals
    of_arm: dict[str, int] = {}
    for other in np.flatnonzero(signals.junction == signals.junction[signal]).tolist():
        if other == signal or signals.kind[other] != SignalKind.LIGHT:
            continue
        turn = math.degrees(float(signals.pose[other, 3] - signals.pose[signal, 3])) % 360.0
        name = _arm(turn)
        if name:
            of_arm.setdefault(name, other)
    return next((of_arm[name] for name in wanted if name in of_arm), -1)


def _arm(turn_deg: float) -> str:
    """CARLA's sectors, by how much further clockwise an arm's traffic heads."""
    if not 30.0 < turn_deg <= 330.0:
        return ""
    if turn_deg > 225.0:
        return "right"
    return "opposite" if turn_deg > 135.0 else "left"


def lights_apart_m(town: Town, a: int, b: int) -> float:
    """Distance of the trigger boxes of two lights [m]."""
    between = town.signals.box[a, :3] - town.signals.box[b, :3]
    return float(np.linalg.norm(between))
