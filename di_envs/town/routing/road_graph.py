"""The planning graph over a town's driving lanes, laid out as CARLA's global planner lays it out.

A node is where pieces of lanes begin, rounded to whole metres; an edge runs along one piece to the
beginning of the next (its points 1 m apart along the road's reference line) or, at no cost, to the
beginning of the piece beside it. The rounding and the free lane changes are CARLA's, and decide
which of two similar ways round a block is taken, so they are kept.

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
from di_envs.town.once import once_a_town
from di_envs.town.plan import RoadOption
from di_envs.town.routing.carla_roads import CarlaRoads, Place, away_m
from di_envs.town.routing.pieces import Piece, cut_lanes
from di_envs.town.routing.snapping import Chords, Snap, lay_chords, snap_to_lane
from di_envs.town.routing.traces import (
    Ruler,
    Trace,
    join_traces,
    lay_ruler,
    places_by_road,
    rows_of,
    successors_of,
    walk_beyond,
)
from di_envs.town.town import Town

STEP_M = 1.0  # between route points, along the road's reference line
INSIDE_M = 1e-9  # of a piece, from its begin
TIE_M = 1e-3  # nearer to a step than that, single precision decides

_CHANGE_LEFT, _CHANGE_RIGHT = 1, 2  # bits of Lanes.change


class Edge(NamedTuple):
    """A way from one node to another: along a piece of lane, or to the piece beside it."""

    source: int
    target: int
    option: RoadOption  # LANEFOLLOW along a piece, else the lane change
    piece: int  # the piece followed, or left
    exit_piece: int  # the piece entered at the end; the same one at a dead end
    lane: int  # that `piece` is a piece of
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
    piece_edge: dict[int, tuple[int, int]]  # by piece, the nodes of the edge that follows it
    ruler: Ruler  # of the town's lanes
    chords: Chords  # of the pieces, to put keypoints on them

    def edge_of_piece(self, piece: int) -> Edge:
        """The edge that follows a piece."""
        source, target = self.piece_edge[piece]
        return self.edges[source][target]

    def snap(self, position: NDArray[np.float64]) -> Snap:
        """Puts a point, (3,) x, y, z, on the driving lane nearest to it in three dimensions."""
        return snap_to_lane(self.town.lanes, self.ruler, self.chords, position)

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


@once_a_town
def build_road_graph(town: Town) -> RoadGraph:
    """Lays out the planning graph of a town's driving lanes.

    Raises:
        ValueError: If the town has no driving lanes.
    """
    if not np.any(town.lanes.kind == LaneKind.DRIVING):
        raise ValueError(
            f"Town '{town.name}' has no driving lanes, so nothing can be routed; "
            "check the lane types in its OpenDRIVE file."
        )
    pieces, ruler = cut_lanes(town), lay_ruler(town.lanes)
    roads = CarlaRoads(town.opendrive)
    builder = _Builder(town, roads, pieces, ruler)
    for piece in range(len(pieces)):
        builder.follow(piece)
    for piece in range(len(pieces)):
        builder.change(piece)
    return RoadGraph(
        town=town,
        nodes=tuple(builder.nodes),
        edges=tuple(builder.edges),
        piece_edge=builder.piece_edge,
        ruler=ruler,
        chords=lay_chords(town, ruler, pieces, roads),
    )


class _Builder:
    """The graph while it grows; the order of insertion is part of the result."""

    def __init__(self, town: Town, roads: CarlaRoads, pieces: list[Piece], ruler: Ruler) -> None:
        self.town = town
        self.lanes = lanes = town.lanes
        self.pieces = pieces
        self.ruler = ruler
        self.carla = roads
        self.steps = _steps_of(lanes, pieces, ruler)
        self.nodes: dict[tuple[float, float, float], int] = {}
        self.edges: list[dict[int, Edge]] = []
        self.piece_edge: dict[int, tuple[int, int]] = {}
        self.between: dict[int, list[Trace]] = {}
        self.of_lane: dict[int, list[int]] = {}
        for i, piece in enumerate(pieces):
            self.of_lane.setdefault(piece.lane, []).append(i)
        self.first_of_lane = {
            piece.lane: i for i, piece in enumerate(pieces) if piece.begin_m == 0.0
        }
        self.next_in_lane = {(piece.lane, piece.begin_m): i for i, piece in enumerate(pieces)}

    def follow(self, index: int) -> None:
        """Adds an edge along a piece to each of those ahead, or to its own end."""
        along, ahead = self.steps[index], self._ahead(self.pieces[index])
        for exit_piece in ahead:
            self._add(index, exit_piece, self._middle(index, exit_piece))
        if not ahead and len(along.lane) > 2:
            self._add(index, index, along.part(slice(1, -1)))

    def _ahead(self, piece: Piece) -> list[int]:
        """The pieces that a piece leads into."""
        following = self.next_in_lane.get((piece.lane, piece.end_m))
        if following is not None:
            return [following]
        return [self.first_of_lane[lane] for lane in successors_of(self.lanes, piece.lane)]

    def _add(self, index: int, exit_piece: int, middle: Trace) -> None:
        piece, begin = self.pieces[index], self.steps[index].part(slice(0, 1))
        end = self.steps[exit_piece].part(slice(-1, None) if exit_piece == index else slice(0, 1))
        source, target = self._node_at(begin.points[0, :3]), self._node_at(end.points[0, :3])
        self.piece_edge[index] = (source, target)
        self.between.setdefault(index, []).append(middle)
        dx, dy = (end.points[0] - begin.points[0])[:2].tolist()
        chord_m = math.hypot(dx, dy) or 1.0
        yaw = float(end.points[0, 3])
        self.edges[source][target] = Edge(
            source=source,
            target=target,
            option=RoadOption.LANEFOLLOW,
            piece=index,
            exit_piece=exit_piece,
            lane=piece.lane,
            cost=len(middle.lane) + 1,
            in_junction=bool(self.lanes.junction[piece.lane] >= 0),
            exit_direction=(math.cos(yaw), math.sin(yaw)),
            chord=(dx / chord_m, dy / chord_m),
            trace=join_traces([begin, middle, end]),
        )

    def _middle(self, index: int, exit_piece: int) -> Trace:
        """The points between: steps of 1 m until the end is at most 1 m away.

        A piece shorter than a step gets one point all the same, beyond its end, as in CARLA.
        """
        piece, along = self.pieces[index], self.steps[index]
        end = self.steps[exit_piece].points[0, :3]
        away = np.linalg.norm(along.points[:-1, :3] - end, axis=1)
        for step in np.flatnonzero(np.abs(away - STEP_M) < TIE_M):
            away[step] = self._settled(index, int(step), exit_piece, float(away[step]))
        if away[0] <= STEP_M:
            lane, road_m = walk_beyond(self.lanes, piece.lane, piece.begin_m + STEP_M)
            return places_by_road(
                self.lanes, self.ruler, np.array([lane], np.int32), np.array([road_m])
            )
        near = np.flatnonzero(away <= STEP_M)
        return along.part(slice(1, int(near[0]) if len(near) else len(away)))

    def _settled(self, index: int, step: int, exit_piece: int, about_m: float) -> float:
        """How far a step of a piece is from the end, as CARLA's single precision has it."""
        here = self._carlas_place(index, step)
        there = self._carlas_place(exit_piece, 0)
        return about_m if here is None or there is None else float(away_m(here, there))

    def _carlas_place(self, index: int, step: int) -> Place | None:
        piece, lanes = self.pieces[index], self.lanes
        rows = rows_of(lanes, piece.lane)
        begin, end = float(lanes.road_m[rows.start]), float(lanes.road_m[rows.stop - 1])
        # a little inside, as in CARLA: where two curves join, the one ahead says where the point is
        station_m = begin + math.copysign(piece.begin_m + step * STEP_M + INSIDE_M, end - begin)
        road = self.town.road_names[lanes.road[piece.lane]]
        return self.carla.place(road, station_m, self.steps[index].points[step])

    def _node_at(self, position: NDArray[np.float64]) -> int:
        x, y, z = (np.round(position, 0) + 0.0).tolist()  # + 0.0 makes one zero of -0.0 and 0.0
        node = self.nodes.setdefault((x, y, z), len(self.edges))
        if node == len(self.edges):
            self.edges.append({})
        return node

    def change(self, index: int) -> None:
        """Adds the lane changes that the markings along a piece allow, in the order they come up.

        A change goes beside the point whose marking allows it. That of a piece shorter than a step
        lies beyond it, on another piece or another road.
        """
        lanes = self.lanes
        if lanes.junction[self.pieces[index].lane] >= 0:
            return
        for steps in self.between.get(index, []):
            found: set[RoadOption] = set()
            for row, place in zip(_points_at(lanes, steps), range(len(steps.lane)), strict=True):
                lane, allowed = int(steps.lane[place]), int(lanes.change[row])
                for bit, option, beside in (
                    (_CHANGE_RIGHT, RoadOption.CHANGELANERIGHT, int(lanes.right[lane])),
                    (_CHANGE_LEFT, RoadOption.CHANGELANELEFT, int(lanes.left[lane])),
                ):
                    if allowed & bit and option not in found and beside >= 0:
                        entered = self._piece_at(beside, float(lanes.road_m[row]))
                        if entered in self.piece_edge:
                            found.add(option)
                            self._add_change(index, entered, option)

    def _piece_at(self, lane: int, station_m: float) -> int:
        """The piece of a lane at a station of its road; -1 where there is none."""
        road_m = abs(station_m - float(self.lanes.road_m[rows_of(self.lanes, lane)][0]))
        for index in self.of_lane.get(lane, []):
            if road_m <= self.pieces[index].end_m:
                return index
        return self.of_lane.get(lane, [-1])[-1]

    def _add_change(self, index: int, beside: int, option: RoadOption) -> None:
        source, target = self.piece_edge[index][0], self.piece_edge[beside][0]
        self.edges[source][target] = Edge(
            source=source,
            target=target,
            option=option,
            piece=index,
            exit_piece=beside,
            lane=self.pieces[index].lane,
            cost=0,
            in_junction=False,
            exit_direction=(0.0, 0.0),
            chord=(0.0, 0.0),
            trace=join_traces([]),
        )


def _steps_of(lanes: Lanes, pieces: list[Piece], ruler: Ruler) -> list[Trace]:
    """Begin of each piece, its steps of 1 m, and its end."""
    along = []
    for piece in pieces:
        span_m = piece.end_m - piece.begin_m
        steps_m = np.arange(1.0, math.floor(span_m / STEP_M + 1e-9) + 1.0) * STEP_M
        along.append(np.concatenate([[0.0], steps_m, [span_m]]) + piece.begin_m)
    counts = [len(steps) for steps in along]
    lane = np.repeat(np.array([piece.lane for piece in pieces], np.int32), counts)
    places = places_by_road(lanes, ruler, lane, np.concatenate(along))
    ends = np.cumsum(counts).tolist()
    return [places.part(slice(a, b)) for a, b in zip([0, *ends[:-1]], ends, strict=True)]


def _points_at(lanes: Lanes, places: Trace) -> NDArray[np.intp]:
    """The lane points nearest to places."""
    nearest = np.rint(places.lane_m / lanes.spacing_m[places.lane]).astype(np.intp)
    first = lanes.first[places.lane].astype(np.intp)
    return first + np.clip(nearest, 0, lanes.count[places.lane] - 1)


def _walk_back(parents: dict[int, int], node: int) -> list[int]:
    path = [node]
    while parents[path[-1]] != -1:
        path.append(parents[path[-1]])
    return path[::-1]
