"""The seven towns that policies are trained in; Town05 is not among them, nor anything like it.

Their styles are those of CARLA's other towns. Maps, routes and triggers are made when they are
first wanted, kept in our caches, and the same everywhere: all draws are keyed by the town's name.
"""

from __future__ import annotations

import hashlib
import json
import random
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from agents.training.street_grids import TownStyle, street_tables
from di_envs.config import check_name
from di_envs.files.caches import ASKED, cache_folders, writable_cache
from di_envs.files.whole import whole_folder
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
ROUTES = 60
ROUTE_M = (250.0, 700.0)
WAYS_A_ROUTE = 60  # that are tried

_STREET = {"lanes": 1, "speed_kmh": 40.0}
_AVENUE = {"lanes": 2, "speed_kmh": 50.0}
_PARKED = {"lanes": 2, "speed_kmh": 50.0, "parking_m": 3.0}
_LANE = {"lanes": 1, "speed_kmh": 30.0, "parking_m": 2.0}
_HIGHWAY = {"lanes": 3, "speed_kmh": 80.0, "median_m": 3.5, "shoulder_m": 3.5, "sidewalk_m": 0.0}
_COUNTRY = {"lanes": 1, "speed_kmh": 70.0, "shoulder_m": 1.5, "sidewalk_m": 0.0}

TRAINING_TOWNS: Mapping[str, TownStyle] = MappingProxyType(
    {
        "small_grid": TownStyle(
            columns=5,
            rows=4,
            block_m=(75.0, 110.0),
            sections={"street": _STREET},
            lines=("street",),
            vehicles=60,
        ),
        "large_grid": TownStyle(
            columns=5,
            rows=5,
            block_m=(90.0, 140.0),
            sections={"avenue": _AVENUE, "parked": _PARKED},
            lines=("avenue", "parked"),
            lights=0.8,
            vehicles=90,
            walkers=60,
        ),
        "suburb": TownStyle(
            columns=5,
            rows=5,
            block_m=(80.0, 150.0),
            sections={"street": _STREET, "lane": _LANE},
            lines=("street", "lane"),
            missing=0.3,
            lights=0.3,
            bend_m=14.0,
            shift_m=4.0,
            vehicles=50,
            walkers=60,
        ),
        "highways": TownStyle(
            columns=4,
            rows=3,
            block_m=(180.0, 260.0),
            sections={"highway": _HIGHWAY, "avenue": _AVENUE},
            lines=("highway", "avenue"),
            missing=0.25,
            lights=0.8,
            vehicles=90,
            walkers=20,
        ),
        "rural": TownStyle(
            columns=4,
            rows=3,
            block_m=(180.0, 280.0),
            sections={"country": _COUNTRY, "street": _STREET},
            lines=("country", "country", "street"),
            missing=0.3,
            lights=0.35,
            bend_m=22.0,
            shift_m=6.0,
            vehicles=40,
            walkers=10,
        ),
        "downtown": TownStyle(
            columns=6,
            rows=4,
            block_m=(80.0, 125.0),
            sections={"avenue": _AVENUE, "street": _STREET, "parked": _PARKED},
            lines=("avenue", "street", "parked"),
            missing=0.15,
            lights=0.9,
            vehicles=90,
            walkers=80,
        ),
        "mixed": TownStyle(
            columns=5,
            rows=4,
            block_m=(90.0, 200.0),
            sections={"avenue": _AVENUE, "street": _STREET, "highway": _HIGHWAY},
            lines=("avenue", "street", "highway"),
            missing=0.25,
            lights=0.5,
            bend_m=16.0,
            vehicles=80,
        ),
    }
)


@dataclass(frozen=True, kw_only=True)
class TownFiles:
    """A training town on disk."""

    name: str
    folder: Path

    @property
    def town(self) -> Path:
        """The OpenDRIVE map."""
        return self.folder / f"{self.name}.xodr"

    @property
    def routes(self) -> Path:
        """Routes in CARLA's XML."""
        return self.folder / "routes.xml"

    @property
    def scenarios(self) -> Path:
        """Triggers in CARLA's JSON."""
        return self.folder / "scenarios.json"

    def options(self) -> dict[str, Any]:
        """As options of an environment."""
        style = TRAINING_TOWNS[self.name]
        return {
            "town": str(self.town),
            "routes": str(self.routes),
            "scenarios": str(self.scenarios),
            "traffic": style.vehicles,
            "walkers": style.walkers,
        }


def town_files(name: str) -> TownFiles:
    """A training town's files; made on first use, in some seconds.

    Raises:
        ValueError: If there is no such town; suggests the nearest.
        OSError: If it cannot be written.
    """
    check_name(name, TRAINING_TOWNS, "training town")
    this = f"{name}-{_recipe_hash(name)}"
    for place in cache_folders("training"):
        files = TownFiles(name=name, folder=place / this)
        if files.scenarios.is_file():
            return files
    kept = writable_cache("training")
    if kept is None:
        raise OSError(f"there is no folder to make the town '{name}' in: name one in {ASKED}")
    with whole_folder(kept / this) as made:
        _make(TownFiles(name=name, folder=made))
    return TownFiles(name=name, folder=kept / this)


def _map(name: str) -> str:
    """The OpenDRIVE text of the first drawn town whose corners fit between its junctions."""
    for table in street_tables(name, TRAINING_TOWNS[name]):
        try:
            return town_text(plan_of(table))
        except ValueError:
            continue
    raise RuntimeError(f"no town of style '{name}' can be drawn: leave out fewer streets")


def _recipe_hash(name: str) -> str:
    recipe = json.dumps([VERSION, name, repr(TRAINING_TOWNS[name])])
    return hashlib.blake2b(recipe.encode(), digest_size=6).hexdigest()


def _make(files: TownFiles) -> None:
    """Writes the map, then routes and triggers on it."""
    files.town.write_text(_map(files.name), encoding="utf-8", newline="\n")
    town = load_town(str(files.town))
    write_routes(files.routes, random_routes(town, files.name))
    write_triggers(files.scenarios, town.name, build_scenarios(town))


def random_routes(town: Town, name: str) -> list[RouteSpec]:
    """Routes over random drives, keyed by the name and their number."""
    graph, routes = build_road_graph(town), list[RouteSpec]()
    for number in range(ROUTES):
        dice = random.Random(f"{name} route {number}")
        for _ in range(WAYS_A_ROUTE):
            way = random_way(town.lanes, dice.uniform(*ROUTE_M), dice)
            route = find_route(graph, way, str(number), town.name) if way else None
            if route is not None:
                routes.append(route)
                break
    return routes


def load_training_town(name: str) -> tuple[Town, tuple[RoutePlan, ...]]:
    """A training town, and its routes planned."""
    from di_envs.route_env import RouteEnv

    env = RouteEnv(observations=("prompt",), **town_files(name).options())
    return env.world.town, env.plans
