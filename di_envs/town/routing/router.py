"""Plans dense routes between keypoints, as the CARLA Leaderboard does.

Keypoints are joined two by two with CARLA's global planner at 1 m, and the pieces laid end to end:
the points follow lane centres, jump sideways at a lane change, and may step back a little where
two pieces meet. Target points are thinned out by the 50 m rule of Leaderboard 1.0.

Points, options and lengths are CARLA's own, to a few centimetres, wherever a keypoint has one
nearest lane. Where several lanes are equally near (connectors that begin at one point, the end of a
lane and the beginning of the next) CARLA takes whichever its search tree happens to visit first;
here it is the first in the order of CARLA's lanes.

Source: behaviour of `agents/navigation/global_route_planner.py` (CARLA Python API, MIT licence) and
of `leaderboard/utils/route_manipulation.py` (CARLA Leaderboard 1.0, MIT licence); our own code.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from di_envs.town.plan import RoadOption, RoutePlan
from di_envs.town.routing.crossings import name_connectors
from di_envs.town.routing.remarks import remarks_on, text_of
from di_envs.town.routing.road_graph import STEP_M, Edge, RoadGraph, build_road_graph
from di_envs.town.routing.snapping import Snap
from di_envs.town.routing.traces import Trace, join_traces
from di_envs.town.routing.turns import TurnMemory, turn_option
from di_envs.town.town import Town

LEAST_M = 1.0  # of a route
MAX_SNAP_M = 60.0  # the official Town05 Short keypoints lie up to 58 m from a lane
TARGET_SPACING_M = 50.0  # Leaderboard 1.0
SKIP_AT_CHANGE = 5  # points by which a lane change moves ahead

Array = TypeVar("Array", bound=NDArray[Any])

_LANE_CHANGES = (RoadOption.CHANGELANELEFT, RoadOption.CHANGELANERIGHT)


class RouteError(ValueError):
    """A route that cannot be planned; the message names the keypoint and what to do."""


def plan_route(
    town: Town,
    keypoints: ArrayLike,
    *,
    route_id: str = "0",
    graph: RoadGraph | None = None,
    max_snap_m: float = MAX_SNAP_M,
) -> RoutePlan:
    """Plans a dense route through keypoints, in order.

    Args:
        town: The town to drive in.
        keypoints: (K, 3) x, y, z [m], world frame, K at least 2. Headings are not asked for, as the
            Leaderboard ignores them: the nearest driving lane decides.
        route_id: Name of the route in plans, results and errors.
        graph: The town's `build_road_graph(town)`, to plan several routes without building it anew.
        max_snap_m: Largest distance of a keypoint from its lane. The default admits the official
            files; files written for one map can ask for a metre.

    Returns:
        The plan, its arrays read-only.

    Raises:
        RouteError: If keypoints are missing, not finite or too far from any driving lane, if no
            way leads from one to the next, or if the whole is no way at all.
        ValueError: If `graph` was built of another town.
    """
    graph = build_road_graph(town) if graph is None else graph
    if graph.town.content_hash != town.content_hash:
        raise ValueError(
            f"The graph was built of town '{graph.town.name}', the route asks for '{town.name}'; "
            "build it of the same town with build_road_graph(town)."
        )
    places = _checked_keypoints(keypoints, route_id)
    snaps = _checked_snaps(graph, places, route_id, max_snap_m)
    turns = TurnMemory()
    pieces: list[Trace] = []
    options: list[int] = []
    for leg in range(len(places) - 1):
        path = _path_between(graph, snaps, leg, route_id)
        laid = _trace_path(graph, path, snaps[leg], snaps[leg + 1], places[leg + 1], turns)
        pieces.append(laid.trace)
        options.extend(laid.options)
    trace = name_connectors(town.lanes, join_traces(pieces))
    plan = _plan_of(town, route_id, places, trace, np.array(options, np.int8))
    if plan.length_m < LEAST_M:
        raise RouteError(
            f"Route '{route_id}' is {plan.length_m:.1f} m long, from {text_of(places[0])} to "
            f"{text_of(places[-1])}: nothing is left to drive. Move the keypoints apart, in the "
            "direction of travel of their lane."
        )
    remarks = remarks_on(places, snaps, [piece.points for piece in pieces])
    return dataclasses.replace(plan, remarks=remarks)


def target_indices(
    points: NDArray[np.float64], option: NDArray[np.int8], spacing_m: float = TARGET_SPACING_M
) -> NDArray[np.int32]:
    """The sparse target points of a dense route, by the rule of Leaderboard 1.0.

    Kept are every lane-change point, every point where the option changes (unless a lane change
    came just before), the first point more than `spacing_m` after the last kept one, and the last.

    Args:
        points: (R, 3 or more) x, y, z of the dense route.
        option: (R,) RoadOption.
        spacing_m: 50 in Leaderboard 1.0, 200 in 2.x.
    """
    step_m = np.linalg.norm(np.diff(points[:, :3], axis=0), axis=1)
    # fifty steps of 1 m are not more than 50 m, whatever their rounding errors add up to; CARLA's
    # single-precision locations let chance decide, so its targets may lie one point to either side
    limit_m = spacing_m + 1e-6
    kept = []
    since_m = 0.0
    before = None
    for i, now in enumerate(option.tolist()):
        changed = now != before and before not in _LANE_CHANGES
        if now in _LANE_CHANGES or changed or since_m > limit_m or i == len(option) - 1:
            kept.append(i)
            since_m = 0.0
        else:
            since_m += float(step_m[i - 1])
        before = now
    return np.array(kept, np.int32)


@dataclass(kw_only=True)
class _LaidLeg:
    """A dense stretch of route, from a keypoint to the next, while it is laid."""

    traces: list[Trace] = field(default_factory=list)
    options: list[int] = field(default_factory=list)

    @property
    def trace(self) -> Trace:
        return join_traces(self.traces)

    def add(self, trace: Trace, option: RoadOption) -> None:
        self.traces.append(trace)
        self.options.extend([int(option)] * len(trace.lane))


def _checked_keypoints(keypoints: ArrayLike, route_id: str) -> NDArray[np.float64]:
    places = np.array(keypoints, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 3:
        raise RouteError(
            f"Route '{route_id}': expected keypoints of shape (K, 3) with x, y, z, "
            f"got shape {places.shape}."
        )
    if len(places) < 2:
        raise RouteError(
            f"Route '{route_id}': expected at least two keypoints, a start and an end, "
            f"got {len(places)}."
        )
    for i in np.flatnonzero(~np.isfinite(places).all(axis=1)):
        raise RouteError(
            f"Route '{route_id}': keypoint {i} is {places[i].tolist()}; "
            "expected finite metres, so correct it in the route file."
        )
    return places


def _checked_snaps(
    graph: RoadGraph, places: NDArray[np.float64], route_id: str, max_snap_m: float
) -> list[Snap]:
    snaps = [graph.snap(place) for place in places]
    for i, snap in enumerate(snaps):
        if snap.distance_m > max_snap_m:
            raise RouteError(
                f"Route '{route_id}': keypoint {i} at {text_of(places[i])} is "
                f"{snap.distance_m:.1f} m from the nearest driving lane of town "
                f"'{graph.town.name}'; at most {max_snap_m:g} m is allowed. The nearest place on a "
                f"lane is {text_of(snap.place.points[0])}: move the keypoint, or check that the "
                "route was written for this town."
            )
        if snap.piece not in graph.piece_edge:
            raise RouteError(
                f"Route '{route_id}': keypoint {i} at {text_of(places[i])} lies on a lane that "
                "leads nowhere; move it to another lane."
            )
    return snaps


def _path_between(graph: RoadGraph, snaps: Sequence[Snap], leg: int, route_id: str) -> list[int]:
    start, end = snaps[leg], snaps[leg + 1]
    path = graph.shortest_path(graph.piece_edge[start.piece][0], graph.piece_edge[end.piece][0])
    if path is None:
        raise RouteError(
            f"Route '{route_id}': no way leads from keypoint {leg} ({_lane_text(graph, start)}) to "
            f"keypoint {leg + 1} ({_lane_text(graph, end)}) in town '{graph.town.name}'; put the "
            "keypoints on lanes that are connected in the direction of travel."
        )
    return [*path, graph.piece_edge[end.piece][1]]


def _trace_path(
    graph: RoadGraph,
    path: list[int],
    start: Snap,
    end: Snap,
    goal: NDArray[np.float64],
    turns: TurnMemory,
) -> _LaidLeg:
    """Lays the points of one leg along a path of nodes."""
    edges = [graph.edges[a][b] for a, b in pairwise(path)]
    leg = _LaidLeg()
    here = start.place
    for i, edge in enumerate(edges):
        option = turn_option(graph, edges, i, turns)
        if edge.option in _LANE_CHANGES:
            leg.add(here, option)
            here = _beyond_change(graph, edge, here)
            leg.add(here, option)
            continue
        along = edge.trace.part(slice(_nearest(edge.trace, here), None))
        if i == len(edges) - 1:
            along = _cut_at_goal(edge, along, end, goal)
        else:
            along = _ending_on(along, edge, edges[i + 1])
        leg.add(along, option)
        here = along.part(slice(-1, None))
    return leg


def _ending_on(along: Trace, edge: Edge, following: Edge) -> Trace:
    """Gives the last point, at which several lanes may begin, to the lane that is followed."""
    if following.lane in (edge.lane, along.lane[-1]):
        return along
    lane, lane_m = along.lane.copy(), along.lane_m.copy()
    lane[-1], lane_m[-1] = following.lane, 0.0
    return along._replace(lane=lane, lane_m=lane_m)


def _beyond_change(graph: RoadGraph, edge: Edge, here: Trace) -> Trace:
    """The place on the lane beside at which a lane change arrives."""
    beside = graph.edge_of_piece(edge.exit_piece).trace
    between = beside.part(slice(1, -1))
    if not len(between.lane):
        return beside.part(slice(-1, None))
    arrival = min(_nearest(between, here) + SKIP_AT_CHANGE, len(between.lane) - 1)
    return between.part(slice(arrival, arrival + 1))


def _cut_at_goal(edge: Edge, along: Trace, end: Snap, goal: NDArray[np.float64]) -> Trace:
    """Ends the last edge less than two steps before the goal.

    Where no point comes that near (a goal beside the road), the piece goes on to the lane's end;
    where the goal lies behind on the same lane, one point is laid.
    """
    stop = np.linalg.norm(along.points[:, :3] - goal, axis=1) < 2.0 * STEP_M
    begin = len(edge.trace.lane) - len(along.lane)
    behind = _nearest(edge.trace, end.place) < begin
    if behind:
        stop |= along.lane == end.lane
    return along.part(slice(0, int(np.argmax(stop)) + 1 if stop.any() else None))


def _nearest(trace: Trace, here: Trace) -> int:
    """Index of the point of a trace nearest to a place, the first of equals."""
    return int(np.argmin(np.linalg.norm(trace.points[:, :3] - here.points[0, :3], axis=1)))


def _plan_of(
    town: Town,
    route_id: str,
    keypoints: NDArray[np.float64],
    trace: Trace,
    option: NDArray[np.int8],
) -> RoutePlan:
    points = trace.points.copy()
    points[:, 3] = (points[:, 3] + math.pi) % (2.0 * math.pi) - math.pi
    step_m = np.linalg.norm(np.diff(points[:, :3], axis=0), axis=1)
    return RoutePlan(
        route_id=route_id,
        town=town.name,
        keypoints=_read_only(keypoints),
        points=_read_only(points),
        option=_read_only(option),
        lane=_read_only(trace.lane),
        lane_m=_read_only(trace.lane_m),
        route_m=_read_only(np.concatenate([[0.0], np.cumsum(step_m)])),
        targets=_read_only(target_indices(points, option)),
        geo_origin=town.geo_origin,
    )


def _read_only(array: Array) -> Array:
    array.flags.writeable = False
    return array


def _lane_text(graph: RoadGraph, snap: Snap) -> str:
    lanes = graph.town.lanes
    road = graph.town.road_names[lanes.road[snap.lane]]
    return f"road {road} lane {lanes.lane_id[snap.lane]} at {text_of(snap.place.points[0])}"
