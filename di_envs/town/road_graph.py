"""The planning graph over a town's driving lanes, laid out as CARLA's global planner lays it out.

A node is where lanes begin, rounded to whole metres; an edge runs along one lane to the beginning
of the next (its points 1 m apart along the road's reference line) or, at no cost, to the beginning
of the lane beside it. The rounding and the free lane changes are CARLA's, and decide which of two
similar ways round a block is taken, so they are kept.

Source: behaviour of `agents/navigation/global_route_planner.py` in the CARLA Python API (Computer
Vision Center, MIT licence), versions 0.9.9 to 0.9.16; the code here is ours.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import LaneKind, Lanes
from di_envs.town.plan import RoadOption
from di_envs.town.snapping import Chords, Snap, lay_chords, snap_to_lane
from di_envs.town.town import Town
from di_envs.town.traces import (
    Trace,
    join_traces,
    place_on_lane,
    successors_of,
    walk_beyond,
    walk_lane,
)

STEP_M = 1.0  # between route points, along the road's reference line

_TABLE_SIZES = (13, 29, 59, 127, 257, 541, 1109, 2357, 5087, 10273, 20753, 42043)  # libstdc++'s
_CHANGE_LEFT, _CHANGE_RIGHT = 1, 2  # bits of Lanes.change


class Edge(NamedTuple):
    """A way from one node to another: along a lane, or to the lane beside it."""

    source: int
    target: int
    option: RoadOption  # LANEFOLLOW along a lane, else the lane change
    lane: int  # the lane followed, or left
    exit_lane: int  # the lane entered at the end; the same one at a dead end
    cost: int  # number of steps
    in_junction: bool
    exit_direction: tuple[float, float]  # unit vector of the lane entered at the end
    chord: tuple[float, float]  # unit vector from begin to end
    trace: Trace  # entry, points between, exit; empty for a lane change


@dataclass(frozen=True, kw_only=True)
class RoadGraph:
    """The graph of one town: built once by `build_road_graph`, then only read."""

    town: Town
    nodes: tuple[tuple[float, float, float], ...]  # rounded positions
    edges: tuple[dict[int, Edge], ...]  # by source node, then by target node, in order of insertion
    lane_edge: dict[int, tuple[int, int]]  # by lane, the nodes of the edge that follows it
    chords: Chords  # of the driving lanes, to put keypoints on them

    def edge_of_lane(self, lane: int) -> Edge:
        """The edge that follows a lane."""
        source, target = self.lane_edge[lane]
        return self.edges[source][target]

    def snap(self, position: NDArray[np.float64]) -> Snap:
        """Projects a point onto the driving lane nearest to it in three dimensions.

        Args:
            position: (3,) x, y, z.
        """
        return snap_to_lane(self.town.lanes, self.chords, position)

    def shortest_path(self, start: int, goal: int) -> list[int] | None:
        """Nodes from `start` to `goal`, or None where there is no way.

        A* as CARLA runs it: ties go to the node found first, in the order of the map's lanes. The
        rounded positions and free lane changes can make the heuristic overestimate, so the path
        is CARLA's choice rather than always the shortest.
        """
        order = 0
        queue = [(0.0, order, start, 0, -1)]
        best = {start: (0, self._straight_m(start, goal))}
        parents: dict[int, int] = {}
        while queue:
            _, _, node, cost, parent = heapq.heappop(queue)
            if node in parents and (parents[node] == -1 or best[node][0] < cost):
                continue
            parents[node] = parent
            if node == goal:
                return _walk_back(parents, node)
            for neighbour, edge in self.edges[node].items():
                reached = cost + edge.cost
                known = best.get(neighbour)
                if known is not None and known[0] <= reached:
                    continue
                ahead = self._straight_m(neighbour, goal) if known is None else known[1]
                best[neighbour] = (reached, ahead)
                order += 1
                heapq.heappush(queue, (reached + ahead, order, neighbour, reached, node))
        return None

    def _straight_m(self, start: int, goal: int) -> float:
        return math.dist(self.nodes[start], self.nodes[goal])


def build_road_graph(town: Town) -> RoadGraph:
    """Lays out the planning graph of a town's driving lanes.

    Raises:
        ValueError: If the town has no driving lanes.
    """
    builder = _Builder(town.lanes)
    driving = _driving_lanes(town)
    if not driving:
        raise ValueError(
            f"Town '{town.name}' has no driving lanes, so nothing can be routed; "
            "check the lane types in its OpenDRIVE file."
        )
    for lane in driving:
        builder.follow(lane)
    for lane in driving:
        builder.change(lane)
    return RoadGraph(
        town=town,
        nodes=tuple(builder.nodes),
        edges=tuple(builder.edges),
        lane_edge=builder.lane_edge,
        chords=lay_chords(town.lanes, driving),
    )


class _Builder:
    """The graph while it grows; the order of insertion is part of the result."""

    def __init__(self, lanes: Lanes) -> None:
        self.lanes = lanes
        self.nodes: dict[tuple[float, float, float], int] = {}
        self.edges: list[dict[int, Edge]] = []
        self.lane_edge: dict[int, tuple[int, int]] = {}
        self.traces: dict[int, list[Trace]] = {}

    def node_at(self, position: NDArray[np.float64]) -> int:
        x, y, z = np.round(position, 0) + 0.0  # -0.0 would be printed, not found
        key = (float(x), float(y), float(z))
        if key not in self.nodes:
            self.nodes[key] = len(self.edges)
            self.edges.append({})
        return self.nodes[key]

    def follow(self, lane: int) -> None:
        """Adds an edge along a lane to each of its successors, or to its own end."""
        successors = successors_of(self.lanes, lane)
        steps = walk_lane(self.lanes, lane, STEP_M)
        begin = place_on_lane(self.lanes, lane, 0.0)
        if not successors:
            end = place_on_lane(self.lanes, lane, float(self.lanes.length_m[lane]))
            self._add(lane, lane, begin, steps, end)
        for successor in successors:
            end = place_on_lane(self.lanes, successor, 0.0)
            self._add(lane, successor, begin, steps, end)

    def _add(self, lane: int, exit_lane: int, begin: Trace, steps: Trace, end: Trace) -> None:
        middle = self._middle(lane, exit_lane, begin, steps, end)
        if middle is None:
            return
        source, target = self.node_at(begin.points[0, :3]), self.node_at(end.points[0, :3])
        self.lane_edge[lane] = (source, target)
        self.traces.setdefault(lane, []).append(middle)
        dx, dy = (end.points[0] - begin.points[0])[:2]
        chord_m = math.hypot(dx, dy) or 1.0
        yaw = float(end.points[0, 3])
        edge = Edge(
            source=source,
            target=target,
            option=RoadOption.LANEFOLLOW,
            lane=lane,
            exit_lane=exit_lane,
            cost=len(middle.lane) + 1,
            in_junction=bool(self.lanes.junction[lane] >= 0),
            exit_direction=(math.cos(yaw), math.sin(yaw)),
            chord=(float(dx) / chord_m, float(dy) / chord_m),
            trace=join_traces([begin, middle, end]),
        )
        self.edges[source][target] = edge

    def _middle(
        self, lane: int, exit_lane: int, begin: Trace, steps: Trace, end: Trace
    ) -> Trace | None:
        """The points between: steps of 1 m until the end is at most 1 m away.

        A lane shorter than a step gets one point all the same, beyond its end, as in CARLA.
        """
        goal = end.points[0, :3]
        if np.linalg.norm(begin.points[0, :3] - goal) > STEP_M:
            near = np.linalg.norm(steps.points[:, :3] - goal, axis=1) <= STEP_M
            return steps.part(slice(0, int(np.argmax(near)) if near.any() else len(near)))
        if len(steps.lane):
            return steps.part(slice(0, 1))
        if exit_lane == lane:
            return None
        return walk_beyond(self.lanes, lane, STEP_M)

    def change(self, lane: int) -> None:
        """Adds the lane changes that the lane's markings allow, in the order they come up."""
        lanes = self.lanes
        if lanes.junction[lane] >= 0:
            return
        for steps in self.traces.get(lane, []):
            found: set[RoadOption] = set()
            for allowed in lanes.change[_point_at(lanes, lane, steps.lane_m)]:
                for bit, option, beside in (
                    (_CHANGE_RIGHT, RoadOption.CHANGELANERIGHT, int(lanes.right[lane])),
                    (_CHANGE_LEFT, RoadOption.CHANGELANELEFT, int(lanes.left[lane])),
                ):
                    if allowed & bit and option not in found and beside in self.lane_edge:
                        found.add(option)
                        self._add_change(lane, beside, option)
                if len(found) == 2:
                    break

    def _add_change(self, lane: int, beside: int, option: RoadOption) -> None:
        source, target = self.lane_edge[lane][0], self.lane_edge[beside][0]
        self.edges[source][target] = Edge(
            source=source,
            target=target,
            option=option,
            lane=lane,
            exit_lane=beside,
            cost=0,
            in_junction=False,
            exit_direction=(0.0, 0.0),
            chord=(0.0, 0.0),
            trace=join_traces([]),
        )


def _driving_lanes(town: Town) -> list[int]:
    """Driving lanes in the order in which CARLA goes through them: it settles ties."""
    lanes = town.lanes
    rank = {road: i for i, road in enumerate(_carla_road_order(town.road_names))}
    driving = [int(lane) for lane in np.flatnonzero(lanes.kind == LaneKind.DRIVING)]
    return sorted(
        driving,
        key=lambda lane: (rank[int(lanes.road[lane])], lanes.section[lane], lanes.lane_id[lane]),
    )


def _carla_road_order(names: tuple[str, ...]) -> list[int]:
    """Indices of roads in the order of CARLA's hash map of road ids.

    CARLA keeps roads in a `std::unordered_map` by id. In GNU's library a new bucket goes to the
    front of the list, as does a new id within its bucket, and all are laid anew when the table
    grows. Files whose ids are not whole numbers keep their own order.
    """
    if not all(name.isdecimal() for name in names):
        return list(range(len(names)))
    order: list[int] = []
    for size in _TABLE_SIZES:
        buckets: dict[int, list[int]] = {}
        for road in [*order, *range(len(order), min(size, len(names)))]:
            buckets.setdefault(int(names[road]) % size, []).append(road)
        order = [road for bucket in reversed(buckets.values()) for road in reversed(bucket)]
        if len(order) == len(names):
            break
    return order


def _point_at(lanes: Lanes, lane: int, lane_m: NDArray[np.float64]) -> NDArray[np.int64]:
    nearest = np.rint(lane_m / lanes.spacing_m[lane]).astype(np.int64)
    return lanes.first[lane] + np.clip(nearest, 0, lanes.count[lane] - 1)


def _walk_back(parents: dict[int, int], node: int) -> list[int]:
    path = [node]
    while parents[path[-1]] != -1:
        path.append(parents[path[-1]])
    return path[::-1]
