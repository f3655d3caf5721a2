"""The seven towns that policies are trained in; Town05 is not among them, nor anything like it.

Their styles are those of CARLA's other towns. Maps, routes and triggers are made when they are
first wanted, kept in our caches, and the same everywhere: all draws are keyed
by the town's name. There is no end to the routes: they come in blocks of `ROUTES`, and the number
of a drive says which is its own.

A policy may be let see Town05 too, as the paper's was: on routes that are no suite's.
"""

from __future__ import annotations

import hashlib
import json
import random
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.training.street_grids import street_tables
from agents.training.town_styles import MADE_TOWNS
from di_envs.config import check_name
from di_envs.files.caches import ASKED, cache_folders, writable_cache
from di_envs.files.whole import whole_folder
from di_envs.suites import Suite, choose_suite, load_suite, suite_names
from di_envs.town.building.junction_layout import town_text
from di_envs.town.building.routes import random_way
from di_envs.town.building.scenarios import build_scenarios
from di_envs.town.building.street_plan import plan_of
from di_envs.town.building.ways import find_route
from di_envs.town.loading import load_town
from di_envs.town.plan import RoutePlan
from di_envs.town.routing.road_graph import build_road_graph
from di_envs.town.routing.routes import RouteSpec, write_routes
from di_envs.town.routing.trigger_files import write_triggers
from di_envs.town.town import Town

VERSION = 1  # of the recipes here; a change that can move a lane, a route or a trigger raises it
ROUTES = 60  # of a block
ROUTE_M = (250.0, 700.0)
WAYS_A_ROUTE = 60  # that are tried
APART_M = 20.0  # of a route's start from those of the suites' routes, and of its end from theirs
_ROUTE_FILE = "routes.xml"

# Towns that are shipped, and that policies may be trained in where somebody asks for it
SHIPPED_TOWNS = ("town05",)
KNOWN_TOWNS = (*MADE_TOWNS, *SHIPPED_TOWNS)


@dataclass(frozen=True, kw_only=True)
class TownFiles:
    """A training town on disk, with a block of its routes.

    Attributes:
        name: The town's.
        folder: Of the routes; a made-up town's first one holds its map and triggers, too.
        town: The OpenDRIVE map.
        scenarios: Triggers in CARLA's JSON.
        traffic: Number of other vehicles.
        walkers: Number of walkers.
    """

    name: str
    folder: Path
    town: Path
    scenarios: Path
    traffic: int
    walkers: int

    @property
    def routes(self) -> Path:
        """Routes in CARLA's XML."""
        return self.folder / _ROUTE_FILE

    def options(self) -> dict[str, Any]:
        """As options of an environment."""
        return {
            "town": str(self.town),
            "routes": str(self.routes),
            "scenarios": str(self.scenarios),
            "traffic": self.traffic,
            "walkers": self.walkers,
        }


def block_of(number: int) -> int:
    """Which block of routes the drive of that number takes its own from."""
    return number // ROUTES


def town_files(name: str, block: int = 0) -> TownFiles:
    """A training town's files; made on first use, in some seconds.

    Args:
        name: Of `KNOWN_TOWNS`.
        block: Which of its routes: those that belong to `ROUTES` numbers of drives.

    Raises:
        ValueError: If there is no such town; suggests the nearest.
        OSError: If it cannot be written.
    """
    check_name(name, KNOWN_TOWNS, "training town")
    files = (_shipped_files if name in SHIPPED_TOWNS else _made_files)(name, block)
    if not files.routes.is_file():
        with whole_folder(files.folder) as made:
            town = training_town(name)
            routes = random_routes(town, name, block, _ends_taken(name))
            write_routes(made / _ROUTE_FILE, routes)
    return files


def _made_files(name: str, block: int) -> TownFiles:
    """Of a made-up town; its map is made if it is not there."""
    first = _place(f"{name}-{_recipe_hash(name)}", "scenarios.json")
    style = MADE_TOWNS[name]
    files = TownFiles(
        name=name,
        folder=_place(f"{first.name}-{block}", _ROUTE_FILE) if block else first,
        town=first / f"{name}.xodr",
        scenarios=first / "scenarios.json",
        traffic=style.vehicles,
        walkers=style.walkers,
    )
    if not files.scenarios.is_file():
        with whole_folder(first) as made:
            _make(name, made)
    return files


def _place(folder: str, holds: str) -> Path:
    """Where a folder with that file lies in our caches, or is to be made.

    Raises:
        OSError: If it is nowhere, and no cache can be written.
    """
    for place in cache_folders("training"):
        if (place / folder / holds).is_file():
            return place / folder
    kept = writable_cache("training")
    if kept is None:
        raise OSError(f"there is no folder to make '{folder}' in: name one in {ASKED}")
    return kept / folder


def _shipped_files(name: str, block: int) -> TownFiles:
    """Of a shipped town, among as many others as in its suites."""
    suites = _suites_in(name)
    suite = next(suite for suite in suites if suite.scenario_paths)
    level = suite.traffic_in(training_town(name))
    ends = hashlib.blake2b(_ends_taken(name).tobytes(), digest_size=6).hexdigest()
    return TownFiles(
        name=name,
        folder=_place(f"{name}-{VERSION}-{ends}-{block}", _ROUTE_FILE),
        town=suite.town_path,
        scenarios=suite.scenario_paths[0],
        traffic=level.vehicles,
        walkers=level.walkers,
    )


def _suites_in(name: str) -> list[Suite]:
    suites = [load_suite(suite) for suite in suite_names()]
    return [suite for suite in suites if suite.town == name]


@cache
def _ends_taken(name: str) -> NDArray[np.float64]:
    """(K, 2, 2) x, y of the start and the end of every suite's route there [m]."""
    if name in MADE_TOWNS:
        return np.zeros((0, 2, 2))
    specs = [spec for suite in _suites_in(name) for spec in suite.specs()]
    return np.array([spec.positions[[0, -1], :2] for spec in specs])


def _map(name: str) -> str:
    """The OpenDRIVE text of the first drawn town whose corners fit between its junctions."""
    for table in street_tables(name, MADE_TOWNS[name]):
        try:
            return town_text(plan_of(table))
        except ValueError:
            continue
    raise RuntimeError(f"no town of style '{name}' can be drawn: leave out fewer streets")


def _recipe_hash(name: str) -> str:
    recipe = json.dumps([VERSION, name, repr(MADE_TOWNS[name])])
    return hashlib.blake2b(recipe.encode(), digest_size=6).hexdigest()


def _make(name: str, folder: Path) -> None:
    """Writes the map, then the first routes and the triggers on it."""
    path = folder / f"{name}.xodr"
    path.write_text(_map(name), encoding="utf-8", newline="\n")
    town = load_town(str(path))
    write_routes(folder / _ROUTE_FILE, random_routes(town, name, 0, _ends_taken(name)))
    write_triggers(folder / "scenarios.json", town.name, build_scenarios(town))


def random_routes(town: Town, name: str, block: int, taken: NDArray[np.float64]) -> list[RouteSpec]:
    """A block of routes over random drives, keyed by the name and their number, which is their id.

    Args:
        town: They are in.
        name: Of the training town.
        block: Which.
        taken: (K, 2, 2) starts and ends that no route of these may share.
    """
    graph, routes = build_road_graph(town), list[RouteSpec]()
    late = MADE_TOWNS[name].late_changes if name in MADE_TOWNS else 0.0
    for number in range(block * ROUTES, (block + 1) * ROUTES):
        dice = random.Random(f"{name} route {number}")
        for _ in range(WAYS_A_ROUTE):
            way = random_way(town.lanes, dice.uniform(*ROUTE_M), dice, late_changes=late)
            route = find_route(graph, way, str(number), town.name) if way else None
            if route is not None and _is_apart(route, taken):
                routes.append(route)
                break
    return routes


def _is_apart(route: RouteSpec, taken: NDArray[np.float64]) -> bool:
    """Whether it begins where none of these begins, and ends where none of these ends."""
    ends = route.positions[[0, -1], :2]
    return bool((np.linalg.norm(taken - ends, axis=2) > APART_M).all())


@cache
def training_town(name: str) -> Town:
    """A training town, read once a process.

    Raises:
        ValueError: If there is no such town; suggests the nearest.
    """
    if name in SHIPPED_TOWNS:
        return load_town(name)
    return load_town(str(town_files(name).town))


@lru_cache(32)
def training_plans(name: str, block: int = 0) -> tuple[RoutePlan, ...]:
    """A block of a training town's routes, planned with the scenarios that they meet."""
    files = town_files(name, block)
    suite = choose_suite(town=files.town, routes=str(files.routes), scenarios=str(files.scenarios))
    return suite.plans(training_town(name))


def training_plan(name: str, route_id: str) -> RoutePlan:
    """The route of that id in a training town, planned."""
    plans = training_plans(name, block_of(int(route_id)))
    return next(plan for plan in plans if plan.route_id == route_id)
