"""Where walkers walk: a graph of sidewalk and crosswalk lines, built once from a town.

Sidewalk lanes are kept where they are clear of driving lanes, cut where crosswalks leave them, and
joined where their ends meet. A crosswalk's line runs from sidewalk to sidewalk.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.town.lanes import Crosswalks, LaneKind, Lanes
from di_envs.town.town import Town
from di_envs.world.walkers.crosswalk_tables import approaches, lights_of, strips
from di_envs.world.walkers.lane_clearance import clearances

BODY_M = 0.25  # half a walker's width
KERB_M = 0.4  # that walkers keep from driving lanes at least …
SWING_M = 1.0  # … and where there is room: long vehicles swing out that far in turns
SIDE_M = 0.5  # that walkers keep to the right of a line, where there is room to its both sides …
REACH_M = 1.25  # … from the line, up to which they go to pass each other …
REACH_STEP_M = 0.25  # … and steps in which room for it is looked for
SHORTEST_M = 3.0  # pieces of sidewalk that are worth walking
LEAST_WALK_M = 20.0  # of sidewalks and crosswalks that lead to each other, for anybody to be there
STEP_M = 0.5  # spacing of the lines made here
FINE_M = 0.1  # steps in which the kerb is looked for
ATTACH_M = 6.0  # from a crosswalk's end to its sidewalk
MEET_M = 0.5  # ends that are the same place
JOIN_M = 3.0  # ends that a straight line joins
LEVEL_M = 3.0

Line = NDArray[np.float64]  # (N, 3) x, y, z


@by_reference
class WalkGraph(NamedTuple):
    """Arrays over edges E, their points P, links N, crosswalks X, approaches V and lights T."""

    # (E,) edges: points [first, first + size) at even spacing
    first: NDArray[np.int32]
    size: NDArray[np.int32]  # number of points
    length_m: NDArray[np.float64]
    spacing_m: NDArray[np.float64]
    # offsets to the right of the line, seen along the edge: where one walks who goes along it and
    # against it, and how far to either side there is room
    forth_m: NDArray[np.float64]
    back_m: NDArray[np.float64]
    right_m: NDArray[np.float64]
    left_m: NDArray[np.float64]
    crosswalk: NDArray[np.int32]  # index into Crosswalks, -1 for sidewalks
    road_begin_m: NDArray[np.float64]  # stations between which it lies on driving lanes
    road_end_m: NDArray[np.float64]
    # edges to go on to: from the start of edge e at [start[2e], start[2e + 1]), from its end at
    # [start[2e + 1], start[2e + 2])
    next_start: NDArray[np.int32]  # (2E + 1,)
    next_edge: NDArray[np.int32]  # (N,)
    next_direction: NDArray[np.int8]  # (N,) 1: it is entered at its start, -1: at its end
    points: NDArray[np.float64]  # (P, 4) x, y, z, yaw along the edge
    strip: NDArray[np.float64]  # (X, 6) centre x, y, z, yaw along it, half length, half width
    # lights that stop the traffic of a crosswalk's arm
    light_start: NDArray[np.int32]  # (X + 1,)
    light: NDArray[np.int32]  # (T,) signal index
    # by lane: crosswalks ahead on it or on the lanes that it leads to
    approach_start: NDArray[np.int32]  # (L + 1,)
    approach: NDArray[np.int32]  # (V,) crosswalk
    approach_lane: NDArray[np.int32]  # (V,) the crossed lane
    approach_begin_m: NDArray[np.float64]  # (V,) from this lane's start to the strip
    approach_end_m: NDArray[np.float64]  # (V,) and to its far side
    # by crosswalk: the lanes that lead to it, those that it crosses among them
    leading_start: NDArray[np.int32]  # (X + 1,)
    leading: NDArray[np.int32]  # (W,)


@dataclass(frozen=True, kw_only=True)
class _Edge:
    line: Line
    left_m: float = 0.0  # room beside the line
    right_m: float = 0.0
    crosswalk: int = -1
    road: tuple[float, float] = (0.0, 0.0)


def build_walk_graph(town: Town) -> WalkGraph:
    """Builds the graph; a town without sidewalks gives one without edges."""
    lanes, crosswalks = town.lanes, town.crosswalks
    pieces = _clear_sidewalks(lanes)
    ends = _attachments(pieces, crosswalks)
    edges = [_sidewalk(lanes, line) for line in _cut(pieces, ends)]
    edges += _links(lanes, [edge.line for edge in edges])
    edges += _crossings(lanes, crosswalks, pieces, ends)
    edges = _without_islands(edges)
    return WalkGraph(
        **_edge_arrays(edges),
        **_next_edges([edge.line for edge in edges]),
        points=_points_of(edges),
        strip=strips(crosswalks),
        **lights_of(lanes, crosswalks, town.signals),
        **approaches(lanes, crosswalks),
    )


def _without_islands(edges: list[_Edge]) -> list[_Edge]:
    """The edges but those of short pieces that lead nowhere: a few on one would jam for ever."""
    links = _next_edges([edge.line for edge in edges])
    start, linked = links["next_start"], links["next_edge"]
    walkable = np.zeros(len(edges))
    for first in range(len(edges)):
        island, front = {first}, [first]
        while front and not walkable[first]:
            at = front.pop()
            ahead = set(linked[start[2 * at] : start[2 * at + 2]].tolist()) - island
            island |= ahead
            front += sorted(ahead)
        if not walkable[first]:
            walkable[sorted(island)] = sum(_length(edges[k].line) for k in sorted(island))
    return [edge for edge, length in zip(edges, walkable, strict=True) if length >= LEAST_WALK_M]


def _clear_sidewalks(lanes: Lanes) -> list[Line]:
    """The runs of sidewalk points that keep clear of driving lanes."""
    pieces = []
    for lane in np.flatnonzero(lanes.kind == LaneKind.SIDEWALK):
        own = lanes.points[lanes.first[lane] : lanes.first[lane] + lanes.count[lane], :3]
        clear = np.concatenate(([False], clearances(lanes, own) >= BODY_M + KERB_M, [False]))
        turns = np.flatnonzero(np.diff(clear))
        for begin, end in zip(turns[::2], turns[1::2], strict=True):
            if (end - begin - 1) * lanes.spacing_m[lane] >= SHORTEST_M:
                pieces.append(np.array(own[begin:end]))
    return pieces


def _attachments(
    pieces: list[Line], crosswalks: Crosswalks
) -> dict[tuple[int, int], tuple[int, int]]:
    """The sidewalk point (piece, point) of each crosswalk end (crosswalk, 0 or 1) that has one."""
    found: dict[tuple[int, int], tuple[int, int]] = {}
    if not pieces:
        return found
    points = np.concatenate(pieces)
    piece_of = np.repeat(np.arange(len(pieces)), [len(piece) for piece in pieces])
    first = np.cumsum([0, *(len(piece) for piece in pieces)])
    for crosswalk in range(crosswalks.width_m.size):
        for side, place in enumerate((crosswalks.start[crosswalk], crosswalks.end[crosswalk])):
            level = np.abs(points[:, 2] - place[2]) < LEVEL_M
            distance = np.where(level, np.hypot(*(points[:, :2] - place[:2]).T), np.inf)
            nearest = int(np.argmin(distance))
            if distance[nearest] <= ATTACH_M:
                piece = int(piece_of[nearest])
                found[crosswalk, side] = piece, _snapped(nearest - int(first[piece]), pieces[piece])
    return found


def _snapped(point: int, piece: Line) -> int:
    """A point of a piece, or the piece's end where that is about a metre away or less."""
    if point <= 2:
        return 0
    return len(piece) - 1 if point >= len(piece) - 3 else point


def _cut(pieces: list[Line], ends: dict[tuple[int, int], tuple[int, int]]) -> list[Line]:
    """The pieces, cut where crosswalks leave them."""
    cuts: list[set[int]] = [{0, len(piece) - 1} for piece in pieces]
    for piece, point in ends.values():
        cuts[piece].add(point)
    return [
        piece[begin : end + 1]
        for piece, points in zip(pieces, cuts, strict=True)
        for begin, end in zip(sorted(points)[:-1], sorted(points)[1:], strict=True)
    ]


def _sidewalk(lanes: Lanes, line: Line) -> _Edge:
    return _Edge(line=line, left_m=_room(lanes, line, -1), right_m=_room(lanes, line, 1))


def _room(lanes: Lanes, line: Line, side: int) -> float:
    """How far to one side of a line (1 right, -1 left) one walks no nearer to driving lanes.

    Beyond what long vehicles swing out in turns, nearer is as good.
    """
    wanted = np.minimum(clearances(lanes, line), BODY_M + SWING_M) - 1e-9
    step = np.gradient(line[:, :2], axis=0)
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9)
    right = np.column_stack((-step[:, 1], step[:, 0], np.zeros(len(line))))
    room = 0.0
    for reach in np.arange(1, round(REACH_M / REACH_STEP_M) + 1) * REACH_STEP_M:
        if (clearances(lanes, line + side * reach * right) < wanted).any():
            break
        room = float(reach)
    return room


def walking_lines(left_m: float, right_m: float) -> tuple[float, float]:
    """Where walkers go along an edge and against it, as offsets to the right of its line [m].

    They are SIDE_M to either side of a middle, which is as near the line as room allows.

    Args:
        left_m: Room to the left of the line.
        right_m: Room to its right.
    """
    half = min(SIDE_M, 0.5 * (left_m + right_m))
    middle = min(max(0.0, half - left_m), right_m - half)
    return middle + half, middle - half


def _links(lanes: Lanes, lines: list[Line]) -> list[_Edge]:
    """Straight joints between ends that nearly meet, where no driving lane lies between."""
    ends = np.array([line[k] for line in lines for k in (0, -1)]).reshape(-1, 3)
    links = []
    for a in range(len(ends)):
        near = np.linalg.norm(ends - ends[a], axis=1)
        if np.count_nonzero(near <= MEET_M) > 1:  # it goes on by itself
            continue
        for b in np.flatnonzero((near > MEET_M) & (near <= JOIN_M)):
            alone = np.count_nonzero(np.linalg.norm(ends - ends[b], axis=1) <= MEET_M) == 1
            if b // 2 == a // 2 or (alone and b < a):  # its own other end, or done from there
                continue
            line = _resample(np.stack((ends[a], ends[b])))
            if clearances(lanes, line).min() >= BODY_M + KERB_M:
                links.append(_sidewalk(lanes, line))
    return links


def _crossings(
    lanes: Lanes,
    crosswalks: Crosswalks,
    pieces: list[Line],
    ends: dict[tuple[int, int], tuple[int, int]],
) -> list[_Edge]:
    """An edge for each crosswalk that has a sidewalk at both ends."""
    edges = []
    for crosswalk in range(crosswalks.width_m.size):
        if (crosswalk, 0) not in ends or (crosswalk, 1) not in ends:
            continue
        a, b = (pieces[piece][point] for piece, point in (ends[crosswalk, 0], ends[crosswalk, 1]))
        start, end = crosswalks.start[crosswalk], crosswalks.end[crosswalk]
        line = _resample(np.stack((a, start, end, b)))
        road = _road_part(lanes, line)
        side = max(0.5 * float(crosswalks.width_m[crosswalk]) - BODY_M, 0.0)
        edges.append(_Edge(line=line, left_m=side, right_m=side, crosswalk=crosswalk, road=road))
    return edges


def _road_part(lanes: Lanes, line: Line) -> tuple[float, float]:
    """Stations between which a line lies on driving lanes; its end twice where it never does."""
    length = _length(line)
    station = np.linspace(0.0, length, max(round(length / FINE_M), 1) + 1)
    even = np.linspace(0.0, length, len(line))
    places = np.stack([np.interp(station, even, line[:, k]) for k in range(3)], axis=1)
    on_road = station[clearances(lanes, places) < 0.0]
    return (float(on_road[0]), float(on_road[-1])) if on_road.size else (length, length)


def _length(line: Line) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def _resample(line: Line) -> Line:
    """The line through the same corners at even spacing, with corners of no length dropped."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    station = np.concatenate(([0.0], np.cumsum(steps)))
    count = max(int(np.ceil(station[-1] / STEP_M)) + 1, 2)
    even = np.linspace(0.0, station[-1], count)
    return np.stack([np.interp(even, station, line[:, k]) for k in range(3)], axis=1)


def _edge_arrays(edges: list[_Edge]) -> dict[str, Any]:
    count = np.array([len(edge.line) for edge in edges], np.int32)
    length = np.array([_length(edge.line) for edge in edges])
    ways = np.array([walking_lines(edge.left_m, edge.right_m) for edge in edges]).reshape(-1, 2)
    return {
        "first": (np.cumsum(count) - count).astype(np.int32),
        "size": count,
        "length_m": length,
        "spacing_m": length / np.maximum(count - 1, 1),
        "forth_m": np.ascontiguousarray(ways[:, 0]),
        "back_m": np.ascontiguousarray(ways[:, 1]),
        "right_m": np.array([edge.right_m for edge in edges], np.float64),
        "left_m": np.array([edge.left_m for edge in edges], np.float64),
        "crosswalk": np.array([edge.crosswalk for edge in edges], np.int32),
        "road_begin_m": np.array([edge.road[0] for edge in edges], np.float64),
        "road_end_m": np.array([edge.road[1] for edge in edges], np.float64),
    }


def _next_edges(lines: list[Line]) -> dict[str, Any]:
    """Which edges begin or end where an edge begins or ends."""
    ends = np.array([line[k] for line in lines for k in (0, -1)]).reshape(-1, 3)
    starts, edges, directions = [0], [], []
    for a in range(len(ends)):
        near = np.flatnonzero(np.linalg.norm(ends - ends[a], axis=1) <= MEET_M)
        others = near[near // 2 != a // 2]
        edges += list(others // 2)
        directions += list(1 - 2 * (others % 2))
        starts.append(len(edges))
    return {
        "next_start": np.array(starts, np.int32),
        "next_edge": np.array(edges, np.int32),
        "next_direction": np.array(directions, np.int8),
    }


def _points_of(edges: list[_Edge]) -> NDArray[np.float64]:
    rows = [np.empty((0, 4))]
    for edge in edges:
        step = np.diff(edge.line[:, :2], axis=0)
        yaw = np.arctan2(step[:, 1], step[:, 0])
        rows.append(np.column_stack((edge.line, np.append(yaw, yaw[-1]))))
    return np.concatenate(rows)
