"""Made-up towns: grids of streets, bent, thinned out and varied by keyed draws.

A grid's nodes become crossings, Ts, bends or nothing, by how many of their streets are left; chains
of streets without a junction become one. The table that comes out is what `street_plan` reads.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

Node = tuple[int, int]  # column, row
Edge = tuple[Node, Node]  # the lower node first

KERB_RADIUS_M = 8.0  # from a crossing street's edge to where a street begins
CORNER_M = 26.0
BEND_RADIUS_M = 120.0
LONG_M = 150.0  # streets that may swing aside, or lead over a viaduct
VIADUCT_M = 5.0  # its height
VIADUCT = (0.3, 0.55, 0.85)  # where a street is at that height, begins to go down, and is down
TRIES = 200


@dataclass(frozen=True, kw_only=True)
class TownStyle:
    """What a town is like.

    Attributes:
        columns: Streets that lead north and south.
        rows: Streets that lead east and west.
        block_m: Shortest and longest distance between two of them.
        sections: Cross sections by name, as `street_plan.CrossSection` has them.
        lines: Names of sections that columns and rows are drawn from.
        missing: Share of streets between two nodes that are left out.
        lights: Share of crossings with lights; Ts have them half as often.
        bend_m: How far the middle of a long street lies aside, at most.
        shift_m: How far a node lies from its place in the grid, at most.
        raised: Share of the long streets that lead over a viaduct.
        late_changes: Share of the junctions before whose line a route changes lane at the last
            moment, where there is a lane beside.
        vehicles: Of the traffic.
        walkers: Beside it.
    """

    columns: int
    rows: int
    block_m: tuple[float, float]
    sections: Mapping[str, Mapping[str, float]]
    lines: tuple[str, ...]
    missing: float = 0.2
    lights: float = 0.6
    bend_m: float = 0.0
    shift_m: float = 2.0
    raised: float = 0.0
    late_changes: float = 0.0
    vehicles: int = 60
    walkers: int = 40


def street_tables(name: str, style: TownStyle) -> Iterator[dict[str, Any]]:
    """Tables of towns of that style, the first that are drawn first; the name keys all draws."""
    for number in range(TRIES):
        dice = random.Random(f"{name} {number}")
        edges = _thinned(style, dice)
        if edges is not None:
            table = _Grid(name, style, edges, dice).table()
            if table is not None:
                yield table


def _thinned(style: TownStyle, dice: random.Random) -> list[Edge] | None:
    """The grid's streets but for some, all joined, none a dead end; None if that failed."""
    nodes = [(i, j) for i in range(style.columns) for j in range(style.rows)]
    across = [((i, j), (i + 1, j)) for i, j in nodes if i + 1 < style.columns]
    along = [((i, j), (i, j + 1)) for i, j in nodes if j + 1 < style.rows]
    edges = [*across, *along]
    for edge in dice.sample(edges, round(style.missing * len(edges))):
        left = [other for other in edges if other != edge]
        if all(_degree(left, node) >= 2 for node in edge) and _joined(left, nodes):
            edges = left
    junctions = [node for node in nodes if _degree(edges, node) >= 3]
    return edges if len(junctions) >= 4 else None


def _degree(edges: list[Edge], node: Node) -> int:
    return sum(node in edge for edge in edges)


def _joined(edges: list[Edge], nodes: list[Node]) -> bool:
    reached, ahead = {nodes[0]}, [nodes[0]]
    while ahead:
        node = ahead.pop()
        for edge in edges:
            if node in edge:
                other = edge[1] if edge[0] == node else edge[0]
                if other not in reached:
                    reached.add(other)
                    ahead.append(other)
    return len(reached) == len(nodes)


class _Grid:
    """Draws places and sections for the streets that are left."""

    def __init__(self, name: str, style: TownStyle, edges: list[Edge], dice: random.Random) -> None:
        self._name, self._style, self._edges, self._dice = name, style, edges, dice
        columns = self._lines(style.columns)
        rows = self._lines(style.rows)
        shift = style.shift_m
        self._place = {
            (i, j): (x + dice.uniform(-shift, shift), y + dice.uniform(-shift, shift))
            for i, x in enumerate(columns)
            for j, y in enumerate(rows)
        }
        self._column = [dice.choice(style.lines) for _ in columns]
        self._row = [dice.choice(style.lines) for _ in rows]

    def _lines(self, count: int) -> list[float]:
        """Where the grid's lines lie, about 0."""
        places = [0.0]
        for _ in range(count - 1):
            places.append(places[-1] + self._dice.uniform(*self._style.block_m))
        return [round(place - 0.5 * places[-1], 1) for place in places]

    def table(self) -> dict[str, Any] | None:
        """The town's table; None if a street would lead back to its own junction."""
        junctions = [node for node in self._place if _degree(self._edges, node) >= 3]
        numbers = {node: 1 + k for k, node in enumerate(junctions)}
        chains = list(self._chains(set(junctions)))
        if any(chain[0] == chain[-1] for chain in chains):
            return None
        sections = [self._section(chain) for chain in chains]
        reach = self._reach(chains, sections)
        streets = [
            {
                "id": 1 + k,
                "section": section,
                "start": numbers[chain[0]],
                "end": numbers[chain[-1]],
                "points": (points := self._points(chain, reach)),
                **self._raised(points),
            }
            for k, (chain, section) in enumerate(zip(chains, sections, strict=True))
        ]
        return {
            "name": self._name,
            "about": "Made up.",
            "latitude": 0.0,
            "longitude": 0.0,
            "sections": {name: dict(values) for name, values in self._style.sections.items()},
            "junctions": [
                {"id": numbers[node], "control": self._control(node)} for node in junctions
            ],
            "streets": streets,
        }

    def _chains(self, junctions: set[Node]) -> Iterator[list[Node]]:
        """The nodes of each street, from junction to junction."""
        left = list(self._edges)
        for start in sorted(junctions):
            while True:
                first = next((edge for edge in left if start in edge), None)
                if first is None:
                    break
                chain, edge = [start], first
                while True:
                    left.remove(edge)
                    chain.append(edge[1] if edge[0] == chain[-1] else edge[0])
                    if chain[-1] in junctions:
                        break
                    edge = next(edge for edge in left if chain[-1] in edge)
                yield chain

    def _section(self, chain: list[Node]) -> str:
        """That of the line on which a street begins."""
        (i, j), (_, k) = chain[0], chain[1]
        return self._row[j] if j == k else self._column[i]

    def _reach(
        self, chains: list[list[Node]], sections: list[str]
    ) -> dict[tuple[Node, Node], float]:
        """How far from a junction's middle the street to the next node begins."""
        arms: dict[Node, dict[Node, float]] = {}
        for chain, section in zip(chains, sections, strict=True):
            for node, beside in ((chain[0], chain[1]), (chain[-1], chain[-2])):
                arms.setdefault(node, {})[beside] = self._half_width(section)
        reach = {}
        for node, widths in arms.items():
            for beside in widths:
                own_is_row = node[1] == beside[1]
                crossing = [w for other, w in widths.items() if (node[1] == other[1]) != own_is_row]
                reach[node, beside] = max(crossing, default=3.5) + KERB_RADIUS_M
        return reach

    def _half_width(self, section: str) -> float:
        values = self._style.sections[section]
        half_median = 0.5 * values.get("median_m", 0.0)
        return 3.5 * values["lanes"] + half_median + values.get("parking_m", 0.0)

    def _points(
        self, chain: list[Node], reach: Mapping[tuple[Node, Node], float]
    ) -> list[list[float]]:
        """The street's polyline: its ends moved back from the junctions, corners rounded."""
        places = [self._place[node] for node in chain]
        points: list[list[float]] = [_towards(places[0], places[1], reach[chain[0], chain[1]])]
        for k in range(1, len(chain)):
            if len(chain) == 2:
                points += self._bend(places[0], places[1])
            if k < len(chain) - 1:
                straight = _turn(places[k - 1], places[k], places[k + 1]) < math.radians(30.0)
                points.append([*places[k], BEND_RADIUS_M if straight else CORNER_M])
        points.append(_towards(places[-1], places[-2], reach[chain[-1], chain[-2]]))
        return [[round(value, 2) for value in point] for point in points]

    def _raised(self, points: list[list[float]]) -> dict[str, list[list[float]]]:
        """The heights of a street that leads over a viaduct; nothing of another."""
        length_m = sum(math.dist(a[:2], b[:2]) for a, b in pairwise(points))
        if self._style.raised == 0.0 or length_m < LONG_M:
            return {}
        if self._dice.random() >= self._style.raised:
            return {}
        up, off, down = (round(share * length_m, 1) for share in VIADUCT)
        return {"profile": [[0.0, 0.0], [up, VIADUCT_M], [off, VIADUCT_M], [down, 0.0]]}

    def _bend(self, start: tuple[float, float], end: tuple[float, float]) -> list[list[float]]:
        """A long street swings aside and back: three corners between its ends."""
        length_m = math.dist(start, end)
        aside = self._dice.uniform(-1.0, 1.0) * self._style.bend_m
        if length_m < LONG_M or abs(aside) < 2.0:
            return []
        along = (end[0] - start[0]) / length_m, (end[1] - start[1]) / length_m
        corners = []
        for share, part in ((0.28, 0.0), (0.5, 1.0), (0.72, 0.0)):
            x = start[0] + share * length_m * along[0] - part * aside * along[1]
            y = start[1] + share * length_m * along[1] + part * aside * along[0]
            corners.append([x, y, 0.5 * BEND_RADIUS_M])
        return corners

    def _control(self, node: Node) -> str:
        crossing = _degree(self._edges, node) == 4
        if self._dice.random() < self._style.lights * (1.0 if crossing else 0.5):
            return "lights"
        return "stop_all" if crossing else "stop_stem"


def _towards(start: tuple[float, float], end: tuple[float, float], metres: float) -> list[float]:
    share = metres / math.dist(start, end)
    return [start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])]


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """The angle [rad] between the ways from a to b and from b to c."""
    first = math.atan2(b[1] - a[1], b[0] - a[0])
    return abs(math.remainder(math.atan2(c[1] - b[1], c[0] - b[0]) - first, 2.0 * math.pi))
