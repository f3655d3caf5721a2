"""Ways through a town: lanes in driving order, from which route files are made.

A way says lane by lane what is driven; its keypoints are laid so that the planner finds that way
and no other, and a way that it would not find is no candidate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from di_envs.town.lanes import LaneKind, Lanes, Turn
from di_envs.town.plan import RoadOption, RoutePlan
from di_envs.town.routing.road_graph import RoadGraph
from di_envs.town.routing.router import RouteError, plan_route
from di_envs.town.routing.routes import Keypoint, RouteSpec
from di_envs.town.routing.traces import rows_of, successors_of

MARGIN_M = 6.0  # of keypoints from both ends of a lane
CHANGE_M = 30.0  # from the keypoint at which a lane change begins to the one that it must reach
LEAST_CHANGE_M = 5.5  # between these where a lane ends; the planner comes over within 5 m
OWN_SNAP_M = 0.1  # keypoints of our own lie on lane centres

_CHANGES = (int(RoadOption.CHANGELANELEFT), int(RoadOption.CHANGELANERIGHT))


@dataclass(frozen=True, kw_only=True)
class Way:
    """A drive along lanes: each goes on from, or lies beside, the one before it.

    Attributes:
        lanes: Indices of driving lanes.
        begin_m: Station on the first lane.
        end_m: Station on the last lane.
        changes_m: For each lane change, in order, the station at which it begins.
    """

    lanes: tuple[int, ...]
    begin_m: float
    end_m: float
    changes_m: tuple[float, ...] = ()


def is_change(lanes: Lanes, before: int, after: int) -> bool:
    """Whether two consecutive lanes of a way lie side by side."""
    return after in (int(lanes.left[before]), int(lanes.right[before]))


def streets(lanes: Lanes) -> list[int]:
    """Driving lanes outside junctions, in the order of the map."""
    driving = (lanes.kind == LaneKind.DRIVING) & (lanes.junction < 0)
    return [int(lane) for lane in np.flatnonzero(driving)]


def connectors(lanes: Lanes) -> list[int]:
    """Driving lanes inside junctions, in the order of the map."""
    driving = (lanes.kind == LaneKind.DRIVING) & (lanes.junction >= 0)
    return [int(lane) for lane in np.flatnonzero(driving)]


def beside(lanes: Lanes, lane: int) -> list[int]:
    """The lanes to either side in the same direction."""
    return [int(side[lane]) for side in (lanes.left, lanes.right) if side[lane] >= 0]


def may_change(lanes: Lanes, lane: int, target: int, lane_m: float) -> bool:
    """Whether the markings allow a change to a lane beside, at a station."""
    point = int(lanes.first[lane] + round(lane_m / float(lanes.spacing_m[lane])))
    bit = 1 if target == lanes.left[lane] else 2
    return bool(lanes.change[point] & bit)


def before(lanes: Lanes, connector: int) -> int:
    """The lane that leads into a connector."""
    return int(lanes.predecessor[lanes.predecessor_start[connector]])


def after(lanes: Lanes, connector: int) -> int:
    """The lane that a connector leads into."""
    return successors_of(lanes, connector)[0]


def keypoints_of(lanes: Lanes, way: Way) -> tuple[Keypoint, ...]:
    """Keypoints that lead along a way: on every street, and on both sides of a lane change."""
    places = [(way.lanes[0], way.begin_m)]
    changes_m = iter(way.changes_m)
    for i, lane in enumerate(way.lanes[1:], start=1):
        if is_change(lanes, way.lanes[i - 1], lane):
            begin_m = next(changes_m)
            places.append((way.lanes[i - 1], begin_m))
            latest_m = max(float(lanes.length_m[lane]) - MARGIN_M, begin_m + LEAST_CHANGE_M)
            places.append((lane, min(begin_m + CHANGE_M, latest_m)))
        elif lanes.junction[lane] < 0:
            places.append((lane, min(2.0 * MARGIN_M, 0.5 * float(lanes.length_m[lane]))))
    last = (way.lanes[-1], way.end_m)
    if places[-1][0] == last[0] and len(places) > 1:
        places.pop()  # the end is on the same lane, so it says as much
    places.append(last)
    kept = [places[0], *(b for a, b in pairwise(places) if b != a)]
    return tuple(_keypoint(lanes, lane, lane_m) for lane, lane_m in kept)


def find_route(graph: RoadGraph, way: Way, route_id: str, town: str) -> RouteSpec | None:
    """The way as a route, or None if the planner would go another way from these keypoints."""
    lanes = graph.town.lanes
    spec = RouteSpec(route_id=route_id, town=town, keypoints=keypoints_of(lanes, way))
    try:
        plan = plan_route(graph.town, spec.positions, graph=graph, max_snap_m=OWN_SNAP_M)
    except RouteError:
        return None
    ahead = np.diff(plan.points[:, :2], axis=0)
    yaw = plan.points[:-1, 3]
    steps_back = (ahead[:, 0] * np.cos(yaw) + ahead[:, 1] * np.sin(yaw)).min() < -0.5
    return None if steps_back or lanes_driven(plan) != way.lanes else spec


def lanes_driven(plan: RoutePlan) -> tuple[int, ...]:
    """The lanes of a plan, in order."""
    lane = plan.lane
    return tuple(int(index) for index in lane[np.append(True, np.diff(lane) != 0)])


def lane_changes(plan: RoutePlan) -> int:
    """How many lane changes a plan commands."""
    changing = np.isin(plan.option, _CHANGES).astype(int)
    return int((np.diff(changing, prepend=0) == 1).sum())


def turns(lanes: Lanes, plan: RoutePlan) -> list[Turn]:
    """How a plan crosses its junctions, in order."""
    return [Turn(int(lanes.turn[lane])) for lane in lanes_driven(plan) if lanes.junction[lane] >= 0]


def length_m(lanes: Lanes, way: Way) -> float:
    """Length of a way along its lanes."""
    total, at_m = 0.0, way.begin_m
    changes_m = iter(way.changes_m)
    for lane, following in pairwise(way.lanes):
        if is_change(lanes, lane, following):
            leaves_m = next(changes_m)
            total, at_m = total + leaves_m - at_m, leaves_m
        else:
            total, at_m = total + float(lanes.length_m[lane]) - at_m, 0.0
    return total + way.end_m - at_m


def _keypoint(lanes: Lanes, lane: int, lane_m: float) -> Keypoint:
    rows = rows_of(lanes, lane)
    row = lane_m / float(lanes.spacing_m[lane])
    axis = np.arange(rows.stop - rows.start)
    x, y, z, yaw = (float(np.interp(row, axis, column)) for column in lanes.points[rows].T)
    degrees = (math.degrees(yaw) + 180.0) % 360.0 - 180.0
    x, y, z, degrees = (round(value, 3) + 0.0 for value in (x, y, z, degrees))
    return Keypoint(x, y, z, yaw_deg=degrees)
