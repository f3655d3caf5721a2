"""Suites: named, versioned sets of routes with the town, timeout, weather and traffic they go with.

A suite is a JSON file in `town/data/suites`. A change that can move a score needs a new version.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from di_envs.config import WEATHERS
from di_envs.files.json_text import read_json
from di_envs.files.json_values import from_json
from di_envs.files.names import check_name
from di_envs.planned_routes import PlannedRoutes, plan_routes
from di_envs.town.plan import RoutePlan
from di_envs.town.routing.remarks import RouteWarning
from di_envs.town.routing.road_graph import build_road_graph
from di_envs.town.routing.router import MAX_SNAP_M
from di_envs.town.routing.routes import BrokenRoute, RouteSpec, read_routes
from di_envs.town.routing.towns import (
    OfTown,
    remark_on_towns,
    routes_of_town,
    those_asked_for,
)
from di_envs.town.routing.trigger_files import PlacedScenario, read_triggers
from di_envs.town.town import Town
from di_envs.traffic_level import TrafficLevel, usual_traffic

DATA = Path(__file__).resolve().parent / "town" / "data"
NO_SCENARIOS = "none"  # in place of a trigger file
TIMEOUT_RULES = ("carla-1.0",)  # int(0.8 s/m x length + 5 s), see RoutePlan.timeout_s


@dataclass(frozen=True, kw_only=True)
class Suite:
    """What an evaluation drives.

    Attributes:
        name: Of a shipped suite, or the stem of the user's route file.
        version: Rises with every change that can move a score; 0 for the user's own files.
        description: One line for lists of suites.
        town: Name of a shipped town, or path of an OpenDRIVE file.
        routes: Name of a shipped route file, or path of one.
        signals: As `load_town` takes it; None for those in the map.
        scenarios: Name of a shipped trigger file, path of one or of a folder of them, or several
            paths with commas between, or `none`; None for those in the route file, if any.
        timeout_rule: Name of the rule for the route timeout.
        weather: Name of one of CARLA's presets.
        traffic: How many others there are; None for as many as the town's lanes are long.
        max_snap_m: Largest distance of a keypoint from its lane.
    """

    name: str
    version: int
    description: str
    town: str
    routes: str
    signals: str | None = None
    scenarios: str | None = None
    timeout_rule: str = "carla-1.0"
    weather: str = "ClearNoon"
    traffic: TrafficLevel | None = None
    max_snap_m: float = MAX_SNAP_M

    def __post_init__(self) -> None:
        check_name(self.timeout_rule, TIMEOUT_RULES, "timeout rule")
        check_name(self.weather, WEATHERS, "weather")

    @property
    def routes_path(self) -> Path:
        """The route file."""
        return shipped_or_own(self.routes, DATA / "routes", ".xml")

    @property
    def town_path(self) -> Path:
        """The OpenDRIVE file."""
        return shipped_or_own(self.town, DATA, ".xodr")

    @property
    def scenario_paths(self) -> tuple[Path, ...]:
        """The trigger files, or folders of them; none where there are none."""
        if self.scenarios is None or self.scenarios == NO_SCENARIOS:
            return ()
        whole = shipped_or_own(self.scenarios, DATA / "scenarios", ".json")
        if whole.exists():
            return (whole,)
        names = [name.strip() for name in self.scenarios.split(",")]
        return tuple(shipped_or_own(name, DATA / "scenarios", ".json") for name in names)

    def specs(
        self, town: str | None = None, route_ids: Sequence[str] | None = None
    ) -> list[RouteSpec]:
        """The suite's routes as their file has them, in the order of the file.

        Args:
            town: Of a file with routes in several towns, take those of this one.
            route_ids: Take only these; None takes all.

        Raises:
            RouteFileError: If the file is broken, or for several towns and not for this one.
            ValueError: If an id is unknown, or is a route's of another town.
        """
        return self._asked_for(self._of_town(town), route_ids).specs

    def _of_town(self, town: str | None) -> OfTown:
        """The routes for a town; of a shipped file, none may be broken."""
        broken: list[BrokenRoute] = []
        specs = read_routes(self.routes_path, None if self.version else broken)
        return routes_of_town(specs, broken, town, self.routes_path.name)

    def _asked_for(self, found: OfTown, route_ids: Sequence[str] | None) -> OfTown:
        file = f"suite '{self.name}'" if self.version else self.routes_path.name
        return those_asked_for(found, route_ids, file)

    def plans(self, town: Town, route_ids: Sequence[str] | None = None) -> tuple[RoutePlan, ...]:
        """Plans the suite's routes in its town: those of `planned`.

        Raises:
            ValueError: As `planned`.
        """
        return self.planned(town, route_ids).plans

    def planned(
        self, town: Town, route_ids: Sequence[str] | None = None, *, strict: bool = False
    ) -> PlannedRoutes:
        """Plans the suite's routes in its town, and says what is to be known of them.

        What a person should look at is warned about too (`RouteWarning`), once for the file.

        Args:
            town: The town that `town_path` and `signals` describe, loaded.
            route_ids: Plan only these, in the order of the file; None plans all.
            strict: Refuse all where one route of the file cannot be planned, asked for or not. Of
                a shipped suite every route that is asked for must be.

        Raises:
            ValueError: As `specs`, if no route can be planned (`RouteError`), or one where that is
                strict, if the file was written for another town and fits this one nowhere
                (`RouteFileError`), and if a trigger file is broken (`TriggerFileError`).
        """
        found, file = self._of_town(town.name), self.routes_path.name
        asked = self._asked_for(found, route_ids)
        remark = "" if self.version else remark_on_towns(build_road_graph(town), found, file)
        tried = found if strict else asked
        planned = plan_routes(
            town,
            tried.specs,
            file=file,
            max_snap_m=self.max_snap_m,
            broken=tried.broken,
            placed=self.placed_scenarios({town.name, *(spec.town for spec in tried.specs)}),
            own_scenarios=self.scenarios is None,
            strict=strict or self.version > 0,
        )
        chosen = {spec.route_id for spec in asked.specs}
        planned = dataclasses.replace(
            planned,
            plans=tuple(plan for plan in planned.plans if plan.route_id in chosen),
            warnings=tuple(filter(None, (remark, *planned.warnings))),
        )
        for text in planned.warnings:
            warnings.warn(text, RouteWarning, stacklevel=2)
        return planned

    def traffic_in(self, town: Town) -> TrafficLevel:
        """How many others there are: as the suite says, or by the length of the town's lanes."""
        return self.traffic or usual_traffic(town.lanes)

    def placed_scenarios(self, towns: Collection[str]) -> tuple[PlacedScenario, ...]:
        """The scenarios placed in a town, wherever its names are found.

        Raises:
            TriggerFileError: If a trigger file is broken, or is for other towns only.
        """
        paths = self.scenario_paths
        return read_triggers(paths, towns) if paths else ()


def suite_names() -> tuple[str, ...]:
    """Names of the shipped suites, in alphabetical order."""
    return tuple(sorted(path.stem for path in (DATA / "suites").glob("*.json")))


def load_suite(name: str) -> Suite:
    """Reads a shipped suite.

    Raises:
        ValueError: If there is none of this name; suggests the nearest.
    """
    check_name(name, suite_names(), "suite")
    return read_suite(DATA / "suites" / f"{name}.json")


def read_suite(path: Path) -> Suite:
    """Reads a suite's file.

    Raises:
        JsonError: If a field is unknown, missing or of another type, or a value is refused.
    """
    return from_json(Suite, read_json(path), str(path))


def choose_suite(
    suite: str | None = None,
    *,
    town: str | Path | None = None,
    routes: str | Path | None = None,
    signals: str | None = None,
    scenarios: str | None = None,
) -> Suite:
    """The suite that a user asks for, by name, by files, or by a name with files in its place.

    Args:
        suite: Name of a shipped suite.
        town: Name of a shipped town, or OpenDRIVE file, instead of the suite's.
        routes: Name of a shipped route file, or route file, instead of the suite's.
        signals: As `load_town` takes it, instead of the suite's. Another town does not inherit the
            suite's signals.
        scenarios: Name of a shipped trigger file, path of one or of a folder of them, instead of
            the suite's or those in the route file, or `none`. Another town does not inherit the
            suite's scenarios.

    Raises:
        ValueError: If the name is unknown, if there is neither a name nor both files, or if a file
            is not there.
    """
    if suite is None and (town is None or routes is None):
        raise ValueError(
            "Expected suite=NAME, or both town=FILE and routes=FILE, got "
            f"suite={suite!r}, town={town!r}, routes={routes!r}; "
            f"shipped suites: {', '.join(suite_names())}."
        )
    chosen = _OWN_FILES if suite is None else load_suite(suite)
    if town is not None:
        chosen = _in_town(chosen, str(town))
    if routes is not None:
        chosen = _over_routes(chosen, str(routes))
    if signals is not None:
        chosen = dataclasses.replace(chosen, signals=signals)
    if scenarios is not None:
        chosen = dataclasses.replace(chosen, scenarios=str(scenarios))
    _check_files(chosen)
    return chosen


_OWN_FILES = Suite(name="", version=0, description="Routes of your own.", town="", routes="")
_CHANGED: dict[str, Any] = {"version": 0, "max_snap_m": MAX_SNAP_M}  # no longer the shipped one


def _in_town(suite: Suite, town: str) -> Suite:
    """The suite in another town, whose signals, scenarios and traffic are its own."""
    own: dict[str, Any] = {"signals": None, "scenarios": None, "traffic": None}
    return dataclasses.replace(suite, town=town, **own, **_CHANGED)


def _over_routes(suite: Suite, routes: str) -> Suite:
    """The suite over other routes, which it is named after."""
    return dataclasses.replace(suite, routes=routes, name=Path(routes).stem, **_CHANGED)


def _check_files(suite: Suite) -> None:
    for path in (suite.town_path, suite.routes_path):
        if not path.is_file():
            raise ValueError(f"There is no file '{path}'; check the path.")
    for path in suite.scenario_paths:
        if not path.exists():
            _refuse_scenarios(path)


def _refuse_scenarios(path: Path) -> NoReturn:
    """Says that there is no such file; of a bare name, which names there are."""
    if path.parent == Path() and not path.suffix:
        shipped = sorted(path.stem for path in (DATA / "scenarios").glob("*.json"))
        check_name(path.name, [*shipped, NO_SCENARIOS], "trigger file")
    raise ValueError(f"There is no trigger file or folder '{path}'; check the path.")


def shipped_or_own(name: str, folder: Path, suffix: str) -> Path:
    """A shipped file by its bare name, or the file at a path."""
    bare = Path(name)
    if bare.parent == Path() and bare.suffix in ("", suffix):
        shipped = folder / f"{bare.stem}{suffix}"
        if shipped.is_file() and not bare.is_file():
            return shipped
    return bare
