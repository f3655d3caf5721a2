"""CARLA's global planner on an offline `carla.Map`: the oracle that our router is put to.

The map is CARLA's own library, which answers every question about lanes; what is done with the
answers is that of `agents/navigation/global_route_planner.py` (CARLA 0.9.12 to 0.9.16, MIT
licence), written anew here, as the wheel has no `agents`. That it does the same is tested on the
official Long routes, which CARLA's own file planned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import networkx
import numpy as np

from di_envs.town.plan import RoadOption

STEP_M = 1.0
FOLLOW = RoadOption.LANEFOLLOW
CHANGES = (RoadOption.CHANGELANELEFT, RoadOption.CHANGELANERIGHT)


def place(waypoint: Any) -> np.ndarray:
    """(3,) x, y, z."""
    location = waypoint.transform.location
    return np.array([location.x, location.y, location.z])


def heading(waypoint: Any) -> np.ndarray:
    vector = waypoint.transform.rotation.get_forward_vector()
    return np.array([vector.x, vector.y, vector.z])


def key(waypoint: Any) -> tuple[int, int, int]:
    """What CARLA calls the piece of lane that a waypoint lies on."""
    return waypoint.road_id, waypoint.section_id, waypoint.lane_id


def away_m(a: Any, b: Any) -> float:
    """In single precision, as CARLA measures between waypoints."""
    return a.transform.location.distance(b.transform.location)


def nearest(waypoint: Any, among: list[Any]) -> int:
    return int(np.argmin([away_m(other, waypoint) for other in among]))


@dataclass
class Segment:
    """A piece of lane, from its first waypoint to the first of a piece ahead."""

    entry: Any
    exit: Any
    path: list[Any]


class CarlaPlanner:
    """Plans as CARLA does; one object remembers its last turn from call to call."""

    def __init__(self, carla: Any, carla_map: Any) -> None:
        self.carla, self.map = carla, carla_map
        self.graph = networkx.DiGraph()
        self.node_of: dict[tuple[float, ...], int] = {}
        self.edge_of: dict[tuple[int, int, int], tuple[int, int]] = {}
        self.segments = [segment for pair in carla_map.get_topology() for segment in cut(*pair)]
        for segment in self.segments:
            self.add(segment)
        self.add_loose_ends()
        for segment in self.segments:
            self.link_changes(segment)
        self.last, self.leaving = RoadOption.VOID, -1

    def add(self, segment: Segment) -> None:
        source, target = self.node(segment.entry), self.node(segment.exit)
        self.edge_of[key(segment.entry)] = (source, target)
        chord = place(segment.exit) - place(segment.entry)
        self.graph.add_edge(
            source,
            target,
            length=len(segment.path) + 1,
            path=segment.path,
            entry=segment.entry,
            exit=segment.exit,
            exit_heading=heading(segment.exit),
            chord=chord / (np.linalg.norm(chord) + np.finfo(float).eps),
            junction=segment.entry.is_junction,
            option=FOLLOW,
        )

    def node(self, waypoint: Any) -> int:
        position = tuple((np.round(place(waypoint), 0) + 0.0).tolist())
        if position not in self.node_of:
            self.node_of[position] = len(self.node_of)
            self.graph.add_node(self.node_of[position], position=position)
        return self.node_of[position]

    def add_loose_ends(self) -> None:
        """Pieces that lead nowhere are in no pair of CARLA's topology."""
        loose = 0
        for segment in self.segments:
            end = segment.exit
            if key(end) in self.edge_of:
                continue
            loose += 1
            source = self.node(end)
            self.edge_of[key(end)] = (source, -loose)
            path, ahead = [], end.next(STEP_M)
            while ahead and key(ahead[0]) == key(end):
                path.append(ahead[0])
                ahead = ahead[0].next(STEP_M)
            if path:
                self.graph.add_node(-loose, position=tuple(place(path[-1])))
                self.graph.add_edge(
                    source,
                    -loose,
                    length=len(path) + 1,
                    path=path,
                    entry=end,
                    exit=path[-1],
                    exit_heading=None,
                    chord=None,
                    junction=end.is_junction,
                    option=FOLLOW,
                )

    def link_changes(self, segment: Segment) -> None:
        """A lane change for each side, at the first waypoint whose marking allows it."""
        change = self.carla.LaneChange
        found: set[RoadOption] = set()
        for waypoint in [] if segment.entry.is_junction else segment.path:
            for option, marking, bit, beside in (
                (CHANGES[1], waypoint.right_lane_marking, change.Right, "get_right_lane"),
                (CHANGES[0], waypoint.left_lane_marking, change.Left, "get_left_lane"),
            ):
                if option in found or not marking or not marking.lane_change & bit:
                    continue
                other = getattr(waypoint, beside)()
                if other is None or other.lane_type != self.carla.LaneType.Driving:
                    continue
                edge = self.localize(other.transform.location)
                if other.road_id != waypoint.road_id or edge is None:
                    continue
                found.add(option)
                self.graph.add_edge(
                    self.node(segment.entry),
                    edge[0],
                    length=0,
                    path=[],
                    entry=waypoint,
                    exit=other,
                    exit_heading=None,
                    junction=False,
                    option=option,
                )

    def localize(self, location: Any) -> tuple[int, int] | None:
        return self.edge_of.get(key(self.map.get_waypoint(location)))

    def plan(self, origin: Any, goal: Any) -> list[tuple[Any, RoadOption]]:
        """The route between two locations, as waypoints with options.

        Raises:
            LookupError: Where CARLA finds none (it fails on a lane that is in no pair).
        """
        start, end = self.localize(origin), self.localize(goal)
        if start is None or end is None:
            raise LookupError("a place on no edge")
        try:
            nodes = networkx.astar_path(
                self.graph, start[0], end[0], heuristic=self.straight_m, weight="length"
            )
        except networkx.NetworkXNoPath as error:
            raise LookupError("no way") from error
        nodes = [*nodes, end[1]]
        here, there = self.map.get_waypoint(origin), self.map.get_waypoint(goal)
        route = []
        for i, (a, b) in enumerate(pairwise(nodes)):
            option = self.turn(i, nodes)
            edge = self.graph.edges[a, b]
            if edge["option"] != FOLLOW:
                laid = self.changed(edge, here)
            else:
                path = [edge["entry"], *edge["path"], edge["exit"]]
                laid = along(path, here, (there, goal) if len(nodes) - i <= 2 else None)
            route += [(waypoint, option) for waypoint in laid]
            here = laid[-1]
        return route

    def changed(self, edge: dict[str, Any], here: Any) -> list[Any]:
        beside = self.graph.edges[self.edge_of[key(edge["exit"])]]
        if not beside["path"]:
            return [here, beside["exit"]]
        place = min(nearest(here, beside["path"]) + 5, len(beside["path"]) - 1)
        return [here, beside["path"][place]]

    def straight_m(self, a: int, b: int) -> float:
        return math.dist(self.graph.nodes[a]["position"], self.graph.nodes[b]["position"])

    def turn(self, i: int, nodes: list[int]) -> RoadOption:
        edge = self.graph.edges[nodes[i], nodes[i + 1]]
        option = edge["option"]
        if i > 0:
            crossing = option == FOLLOW and edge["junction"]
            if (
                crossing
                and self.last != RoadOption.VOID
                and self.leaving > 0
                and self.leaving != nodes[i - 1]
            ):
                option = self.last
            else:
                self.leaving = -1
                before = self.graph.edges[nodes[i - 1], nodes[i]]
                if crossing and before["option"] == FOLLOW and not before["junction"]:
                    tail = self.last_in_junction(i, nodes)
                    if before["exit_heading"] is None or tail["exit_heading"] is None:
                        return FOLLOW
                    option = self.turn_of(nodes[i], nodes[i + 1], before, tail)
        self.last = option
        return option

    def last_in_junction(self, i: int, nodes: list[int]) -> dict[str, Any]:
        tail = self.graph.edges[nodes[i], nodes[i + 1]]
        for a, b in pairwise(nodes[i:]):
            edge = self.graph.edges[a, b]
            if edge["option"] != FOLLOW or not edge["junction"]:
                break
            tail, self.leaving = edge, b
        return tail

    def turn_of(self, node: int, chosen: int, before: dict, tail: dict) -> RoadOption:
        ahead, leaving = before["exit_heading"], tail["exit_heading"]
        others = [
            np.cross(ahead, edge["chord"])[2]
            for other, edge in self.graph.adj[node].items()
            if edge["option"] == FOLLOW and other != chosen
        ] or [0.0]
        across = np.cross(ahead, leaving)[2]
        cosine = ahead @ leaving / (np.linalg.norm(ahead) * np.linalg.norm(leaving))
        if math.acos(float(np.clip(cosine, -1.0, 1.0))) < math.radians(35.0):
            return RoadOption.STRAIGHT
        if across < min(others):
            return RoadOption.LEFT
        if across > max(others):
            return RoadOption.RIGHT
        return RoadOption.LEFT if across < 0.0 else RoadOption.RIGHT


def cut(entry: Any, exit_: Any) -> list[Segment]:
    """The segment of a pair of CARLA's topology; none at the edge of the map."""
    path = []
    if away_m(entry, exit_) > STEP_M:
        waypoint = entry.next(STEP_M)[0]
        while away_m(waypoint, exit_) > STEP_M:
            path.append(waypoint)
            ahead = waypoint.next(STEP_M)
            if not ahead:
                break
            waypoint = ahead[0]
    else:
        ahead = entry.next(STEP_M)
        if not ahead:
            return []
        path.append(ahead[0])
    return [Segment(entry, exit_, path)]


def along(path: list[Any], here: Any, end: tuple[Any, Any] | None) -> list[Any]:
    """The waypoints of an edge from the nearest on; the last edge ends at the goal."""
    begin = nearest(here, path)
    if end is None:
        return path[begin:]
    there, goal = end
    laid = []
    for waypoint in path[begin:]:
        laid.append(waypoint)
        if waypoint.transform.location.distance(goal) < 2.0 * STEP_M:
            break
        if key(waypoint) == key(there) and begin > nearest(there, path):
            break
    return laid
