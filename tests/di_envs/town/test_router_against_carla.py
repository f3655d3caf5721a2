"""The router against CARLA's planner on `carla.Map`: random pairs of places on every map at hand.

Run with `-s` for the share of pairs that are equal, by map and by cause.
"""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from di_envs.town.lanes import LaneKind
from di_envs.town.loading import load_town
from di_envs.town.plan import RoadOption, RoutePlan
from di_envs.town.routing.road_graph import RoadGraph, build_road_graph
from di_envs.town.routing.router import RouteError, plan_route
from di_envs.town.routing.routes import read_routes
from tests.carla_wheel import carla_wheel
from tests.di_envs.town.carla_planner import CarlaPlanner, place

carla = carla_wheel()

MAPS = ("Town01", "Town01_2020", "Town04_2020", "Town05")
SAME_M = 0.05  # CARLA evaluates curves, we interpolate between points 0.5 m apart
TIED_M = 0.02  # two lanes so nearly as near as each other: CARLA's tree decides, not a distance


@dataclass
class Rivals:
    """Both planners on one map."""

    graph: RoadGraph
    planner: CarlaPlanner

    def theirs(self, a: np.ndarray, b: np.ndarray) -> list[tuple[Any, RoadOption]] | None:
        self.planner.last, self.planner.leaving = RoadOption.VOID, -1
        try:
            return self.planner.plan(carla.Location(*a.tolist()), carla.Location(*b.tolist()))
        except LookupError:
            return None

    def ours(self, a: np.ndarray, b: np.ndarray) -> RoutePlan | None:
        try:
            return plan_route(self.graph.town, [a, b], graph=self.graph)
        except RouteError:
            return None

    def difference(self, a: np.ndarray, b: np.ndarray) -> str:
        """What is not equal; empty if all is."""
        theirs, ours = self.theirs(a, b), self.ours(a, b)
        if ours is None:
            # a single point is no way to drive: it is refused, CARLA hands it out
            return "" if theirs is None or len(theirs) == 1 else "refused here"
        if theirs is None:
            return "refused there"
        if len(theirs) != len(ours.points):
            return "number of points"
        points = np.array([place(waypoint) for waypoint, _ in theirs])
        if np.linalg.norm(points - ours.points[:, :3], axis=1).max() > SAME_M:
            return "places"
        return "" if [option for _, option in theirs] == ours.option.tolist() else "options"


def rivals_on(shared: Path, name: str) -> Rivals:
    town = load_town(shared / f"data/xodr/{name}.xodr", signals="none")
    return Rivals(build_road_graph(town), CarlaPlanner(carla, carla.Map(name, town.opendrive)))


def random_place(graph: RoadGraph, draws: np.random.Generator) -> np.ndarray:
    """Somewhere on a driving lane, where no other lane is as near."""
    lanes = graph.town.lanes
    inside = (lanes.kind[lanes.point_lane] == LaneKind.DRIVING)[:-1] & (
        np.diff(lanes.point_lane) == 0
    )
    while True:
        row, share = draws.choice(np.flatnonzero(inside)), draws.random()
        spot = (1.0 - share) * lanes.points[row, :3] + share * lanes.points[row + 1, :3]
        if not tied(graph, spot):
            return np.asarray(spot, np.float32).astype(float)  # what CARLA's locations hold


def tied(graph: RoadGraph, spot: np.ndarray) -> bool:
    chords = graph.chords
    step, off = chords.end - chords.begin, spot - chords.begin
    square = np.maximum(np.einsum("ij,ij->i", step, step), 1e-12)
    share = np.clip(np.einsum("ij,ij->i", off, step) / square, 0.0, 1.0)
    away = np.linalg.norm(off - share[:, None] * step, axis=1)
    return len(set(chords.lane[away < away.min() + TIED_M].tolist())) > 1


def share_equal(rivals: Rivals, pairs: int) -> float:
    draws = np.random.default_rng(0)
    causes = Counter(
        rivals.difference(random_place(rivals.graph, draws), random_place(rivals.graph, draws))
        for _ in range(pairs)
    )
    equal = causes.pop("", 0) / pairs
    print(f"{rivals.graph.town.name}: {equal:.1%} of {pairs} pairs equal; else {dict(causes)}")
    return equal


def test_the_oracle_plans_the_long_routes_as_carlas_own_file_did(shared: Path) -> None:
    rivals = rivals_on(shared, "Town05")
    oracle = json.loads((shared / "data/town05_long_routes_1m.json").read_text())["routes"]
    for spec in read_routes(shared / "data/routes/routes_town05_long.xml")[:4]:
        rows = oracle[f"long_{spec.route_id}"]
        rivals.planner.last, rivals.planner.leaving = RoadOption.VOID, -1
        stops = [carla.Location(*position) for position in spec.positions.tolist()]
        route = [step for a, b in pairwise(stops) for step in rivals.planner.plan(a, b)]
        assert [option.name for _, option in route] == [row[4] for row in rows]
        points = np.array([place(waypoint) for waypoint, _ in route])
        assert np.abs(points - [row[:3] for row in rows]).max() < 0.002


@pytest.mark.parametrize("name", MAPS)
def test_random_pairs_are_planned_as_carla_plans_them(shared: Path, name: str) -> None:
    assert share_equal(rivals_on(shared, name), 60) >= 0.98


@pytest.mark.full
@pytest.mark.parametrize("name", MAPS)
def test_nearly_all_of_a_thousand_pairs_are_planned_as_carla_plans_them(
    shared: Path, name: str
) -> None:
    assert share_equal(rivals_on(shared, name), 1000) >= 0.995
