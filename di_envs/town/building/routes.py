"""Writes the shipped routes: `python -m di_envs.town.building.routes`.

Places are found, not drawn: candidates are enumerated from the lane network in a fixed order, and
chosen by the criteria below. The same map gives the same files.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from di_envs.town.building.street_plan import Control, read_plan
from di_envs.town.building.ways import (
    CHANGE_M,
    MARGIN_M,
    Way,
    after,
    before,
    beside,
    connectors,
    find_route,
    length_m,
    may_change,
    streets,
)
from di_envs.town.lanes import Lanes, Turn
from di_envs.town.loading import load_town
from di_envs.town.routing.road_graph import RoadGraph, build_road_graph
from di_envs.town.routing.routes import RouteSpec, write_routes

DATA = Path(__file__).parents[1] / "data"
FACTS = DATA / "town05_facts.json"
ROUTES = DATA / "routes"

LONG_LENGTHS_M = (2000.0, 1800.0, 1600.0, 1400.0, 1300.0, 1200.0, 1100.0, 1000.0, 900.0, 800.0)
WALKS_A_ROUTE = 1500  # random drives from which each long route is chosen
METRES_A_JUNCTION = 108.0  # the official Long routes have 11.5 junctions on 1290 m
METRES_A_CHANGE = 225.0  # and 5.3 lane changes; the walks come out a little below
LATE_M = (6.5, 12.5)  # before a junction's line, where a late lane change begins
TINY_A_JUNCTION = 5


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of short route: how many, what they cross, how far before and after."""

    count: int
    lit: bool
    turns: tuple[Turn, ...]
    change: bool  # from the lane beside, on the way to the junction
    ahead_m: float  # from the start to the junction
    behind_m: float  # from the junction to the end


# A light takes a perfect driver up to 50 s, the timeout gives 0.8 s/m: routes with one are longer.
SHORT_CROSSINGS = (
    Kind(count=5, lit=False, turns=(Turn.LEFT, Turn.RIGHT), change=True, ahead_m=58, behind_m=20),
    Kind(count=5, lit=True, turns=(Turn.LEFT, Turn.RIGHT), change=True, ahead_m=56, behind_m=44),
    Kind(count=4, lit=False, turns=(Turn.LEFT,), change=False, ahead_m=30, behind_m=35),
    Kind(count=4, lit=False, turns=(Turn.RIGHT,), change=False, ahead_m=30, behind_m=35),
    Kind(count=3, lit=False, turns=(Turn.STRAIGHT,), change=False, ahead_m=32, behind_m=35),
    Kind(count=3, lit=True, turns=(Turn.LEFT,), change=False, ahead_m=30, behind_m=57),
    Kind(count=2, lit=True, turns=(Turn.RIGHT,), change=False, ahead_m=28, behind_m=65),
    Kind(count=2, lit=True, turns=(Turn.STRAIGHT,), change=False, ahead_m=30, behind_m=62),
)


def build_long(graph: RoadGraph, town: str) -> list[RouteSpec]:
    """Ten routes over all parts of the town."""
    lanes = graph.town.lanes
    seen: Counter[int] = Counter()
    routes: list[RouteSpec] = []
    for number, goal_m in enumerate(LONG_LENGTHS_M):
        dice = random.Random(number)
        walks = [random_way(lanes, goal_m, dice) for _ in range(WALKS_A_ROUTE)]
        ranked = sorted((walk for walk in walks if walk), key=_cost_of(lanes, seen))
        for way in ranked:
            route = find_route(graph, way, str(number), town)
            if route is not None:
                routes.append(route)
                seen.update(way.lanes)
                break
        else:
            raise RuntimeError(f"No drive of {goal_m:g} m found for long route {number}.")
    return routes


def _cost_of(lanes: Lanes, seen: Counter[int]) -> Callable[[Way], float]:
    """What makes a long route less welcome: places seen before, and untypical counts."""

    def cost(way: Way) -> float:
        total_m = length_m(lanes, way)
        crossings = sum(int(lanes.junction[lane] >= 0) for lane in way.lanes)
        again_m = sum(float(lanes.length_m[lane]) for lane in way.lanes if seen[lane])
        return (
            again_m / total_m
            + abs(crossings - total_m / METRES_A_JUNCTION) / 8.0
            + abs(len(way.changes_m) - total_m / METRES_A_CHANGE) / 3.0
        )

    return cost


def random_way(
    lanes: Lanes, goal_m: float, dice: random.Random, *, late_changes: float = 0.0
) -> Way | None:
    """A random drive of a given length that crosses no connector twice; None where it got stuck.

    Args:
        lanes: It leads along.
        goal_m: How long it is to be.
        dice: Which it is drawn by.
        late_changes: At which share of the junctions it changes lane just before the line, where
            there is a lane beside.
    """
    lane = dice.choice(streets(lanes))
    begin_m = MARGIN_M + dice.random() * 0.5 * float(lanes.length_m[lane])
    path, changes_m, at_m, left_m = [lane], [], begin_m, goal_m
    while True:
        change_m = at_m + MARGIN_M + dice.random() * 40.0
        options = beside(lanes, lane)
        room_m = float(lanes.length_m[lane]) - change_m - CHANGE_M - 2.0 * MARGIN_M
        if options and room_m > 0.0 and left_m > 80.0 and dice.random() < 0.45:
            target = dice.choice(options)
            if may_change(lanes, lane, target, change_m):
                path.append(target)
                changes_m.append(change_m)
                left_m, at_m, lane = left_m - (change_m - at_m), change_m + CHANGE_M, target
                left_m -= CHANGE_M
        end_m = at_m + left_m
        if end_m <= float(lanes.length_m[lane]) - MARGIN_M:
            return _way(path, begin_m, max(end_m, at_m + MARGIN_M), changes_m)
        if late_changes and dice.random() < late_changes:
            change_m = float(lanes.length_m[lane]) - dice.uniform(*LATE_M)
            options = [beside_it for beside_it in beside(lanes, lane) if beside_it not in path]
            if options and change_m > at_m + CHANGE_M:
                target = dice.choice(options)
                if may_change(lanes, lane, target, change_m):
                    path.append(target)
                    changes_m.append(change_m)
                    left_m, at_m, lane = left_m - (change_m - at_m), change_m, target
        ahead = [
            c for c in connectors_of(lanes, lane) if c not in path and after(lanes, c) not in path
        ]
        if not ahead:
            return None
        connector = dice.choice(ahead)
        left_m -= float(lanes.length_m[lane]) - at_m + float(lanes.length_m[connector])
        lane, at_m = after(lanes, connector), 0.0
        path += [connector, lane]
        left_m = max(left_m, 3.0 * MARGIN_M)


def connectors_of(lanes: Lanes, lane: int) -> list[int]:
    """The ways through the junction at a lane's end."""
    start, stop = lanes.successor_start[lane], lanes.successor_start[lane + 1]
    return [int(connector) for connector in lanes.successor[start:stop]]


def _way(path: list[int], begin_m: float, end_m: float, changes_m: list[float]) -> Way:
    return Way(lanes=tuple(path), begin_m=begin_m, end_m=end_m, changes_m=tuple(changes_m))


def build_short(graph: RoadGraph, town: str, lit: frozenset[int]) -> list[RouteSpec]:
    """Thirty-two routes of 70 to 150 m, each with at most one junction."""
    lanes = graph.town.lanes
    used: Counter[int] = Counter()
    routes: list[RouteSpec] = []
    for kind in SHORT_CROSSINGS:
        for _ in range(kind.count):
            ways = [way for way in _crossings(lanes, kind, lit) if not used[way.lanes[-2]]]
            ways.sort(key=lambda way: (used[-1 - int(lanes.junction[way.lanes[-2]])],))
            route, way = _first_found(graph, ways, str(len(routes)), town)
            used.update([way.lanes[-2], -1 - int(lanes.junction[way.lanes[-2]])])
            routes.append(route)
    for way in _along_streets(lanes):
        route, _ = _first_found(graph, [way], str(len(routes)), town)
        routes.append(route)
    return routes


def _first_found(
    graph: RoadGraph, ways: list[Way], route_id: str, town: str
) -> tuple[RouteSpec, Way]:
    for way in ways:
        route = find_route(graph, way, route_id, town)
        if route is not None:
            return route, way
    raise RuntimeError(f"None of {len(ways)} candidates for route {route_id} can be planned.")


def _crossings(lanes: Lanes, kind: Kind, lit: frozenset[int]) -> Iterator[Way]:
    """All ways of a kind, by the map's order of connectors."""
    for connector in connectors(lanes):
        if (int(lanes.junction[connector]) in lit) != kind.lit:
            continue
        if Turn(int(lanes.turn[connector])) not in kind.turns:
            continue
        approach, leave = before(lanes, connector), after(lanes, connector)
        begin_m = float(lanes.length_m[approach]) - kind.ahead_m
        if begin_m < MARGIN_M or float(lanes.length_m[leave]) < kind.behind_m + MARGIN_M:
            continue
        if not kind.change:
            yield _way([approach, connector, leave], begin_m, kind.behind_m, [])
            continue
        for start in beside(lanes, approach):
            change_m = begin_m + 2.0 * MARGIN_M
            if may_change(lanes, start, approach, change_m):
                yield _way([start, approach, connector, leave], begin_m, kind.behind_m, [change_m])


def _along_streets(lanes: Lanes) -> Iterator[Way]:
    """Routes without a junction: lane changes on the ring, high and low, and two bends."""
    by_length = sorted(streets(lanes), key=lambda lane: -float(lanes.length_m[lane]))
    raised = [lane for lane in by_length if _middle_z(lanes, lane) > 5.0 and beside(lanes, lane)]
    ring = [
        lane for lane in by_length if _middle_z(lanes, lane) < 1.0 and len(beside(lanes, lane)) == 2
    ]
    single = [lane for lane in by_length if not beside(lanes, lane)]
    bent = [lane for lane in by_length if _of_two(lanes, lane) and _turns_by(lanes, lane)]
    for lane in (raised[0], ring[0]):
        begin_m = 0.5 * float(lanes.length_m[lane]) - 60.0
        target = beside(lanes, lane)[0]
        yield _way([lane, target], begin_m, begin_m + 120.0, [begin_m + 40.0])
    for lane in (single[0], bent[0]):
        begin_m = 0.5 * float(lanes.length_m[lane]) - 45.0
        yield _way([lane], begin_m, begin_m + 90.0, [])


def _of_two(lanes: Lanes, lane: int) -> bool:
    """Whether a street has two lanes in a direction."""
    others = beside(lanes, lane)
    return len(others) == 1 and beside(lanes, others[0]) == [lane]


def _middle_z(lanes: Lanes, lane: int) -> float:
    return float(lanes.points[lanes.first[lane] + lanes.count[lane] // 2, 2])


def _turns_by(lanes: Lanes, lane: int) -> bool:
    """Whether a lane goes round a corner."""
    first, last = lanes.first[lane], lanes.first[lane] + lanes.count[lane] - 1
    return abs(float(lanes.points[last, 3] - lanes.points[first, 3])) > 1.0


def build_tiny(graph: RoadGraph, town: str) -> list[RouteSpec]:
    """Five single crossings at every junction, over as many arms and turns as there are."""
    lanes = graph.town.lanes
    routes: list[RouteSpec] = []
    by_junction: dict[int, list[int]] = {}
    for connector in connectors(lanes):
        by_junction.setdefault(int(lanes.junction[connector]), []).append(connector)
    for junction in sorted(by_junction):
        used: Counter[tuple[str, int]] = Counter()
        waiting = list(by_junction[junction])
        for _ in range(min(TINY_A_JUNCTION, len(waiting))):
            waiting.sort(key=lambda c: _familiar(lanes, c, used))
            ways = [_tiny_way(lanes, connector) for connector in waiting]
            route, way = _first_found(graph, ways, str(len(routes)), town)
            routes.append(route)
            waiting.remove(way.lanes[1])
            used.update(_marks(lanes, way.lanes[1]))
    return routes


def build_toy(graph: RoadGraph, town: str) -> list[RouteSpec]:
    """The toy town's first crossing of each kind at each junction, and a lane change."""
    lanes = graph.town.lanes
    ways: dict[tuple[int, int], Way] = {}
    for connector in connectors(lanes):
        approach, leave = before(lanes, connector), after(lanes, connector)
        begin_m = float(lanes.length_m[approach]) - 30.0
        key = (int(lanes.junction[connector]), int(lanes.turn[connector]))
        ways.setdefault(key, _way([approach, connector, leave], begin_m, 40.0, []))
    wide = next(lane for lane in streets(lanes) if lanes.right[lane] >= 0)
    ways[-1, 0] = _way([wide, int(lanes.right[wide])], 20.0, 140.0, [50.0])
    chosen = [_first_found(graph, [way], str(i), town) for i, way in enumerate(ways.values())]
    return [route for route, _ in chosen]


def _marks(lanes: Lanes, connector: int) -> list[tuple[str, int]]:
    approach, leave = before(lanes, connector), after(lanes, connector)
    return [
        ("turn", int(lanes.turn[connector])),
        ("from", int(lanes.road[approach])),
        ("to", int(lanes.road[leave])),
    ]


def _familiar(lanes: Lanes, connector: int, used: Counter[tuple[str, int]]) -> int:
    return sum(used[mark] for mark in _marks(lanes, connector))


def _tiny_way(lanes: Lanes, connector: int) -> Way:
    """From 12 m before a junction to as far behind it, or where the lanes are shorter."""
    approach, leave = before(lanes, connector), after(lanes, connector)
    begin_m = max(float(lanes.length_m[approach]) - 12.0, MARGIN_M)
    end_m = min(12.0, float(lanes.length_m[leave]) - MARGIN_M)
    return _way([approach, connector, leave], begin_m, end_m, [])


def lit_junctions(names: tuple[str, ...]) -> frozenset[int]:
    """Indices of the junctions that have lights, by the table that the Town05 map is made of."""
    plan = read_plan(FACTS)
    lit = {str(j.id) for j in plan.junctions if j.control is Control.LIGHTS}
    return frozenset(i for i, name in enumerate(names) if name in lit)


def main() -> None:
    """Writes the route files of the shipped suites."""
    town = load_town("town05")
    graph = build_road_graph(town)
    suites = {
        "toy": build_toy(build_road_graph(load_town("toy")), "toy"),
        "town05_long": build_long(graph, "Town05"),
        "town05_short": build_short(graph, "Town05", lit_junctions(town.junction_names)),
        "town05_tiny": build_tiny(graph, "Town05"),
    }
    ROUTES.mkdir(exist_ok=True)
    for name, routes in suites.items():
        write_routes(ROUTES / f"{name}.xml", routes)
        print(f"wrote {len(routes)} routes to {ROUTES / name}.xml")


if __name__ == "__main__":
    main()
