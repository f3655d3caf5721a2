"""CARLA route files: reading them, in the layouts of Leaderboard 1.0 and 2.x, and writing them.

1.0 lists `<waypoint x= y= z= pitch= roll= yaw=/>` below each `<route>`, 2.x lists
`<waypoints><position x= y= z=/></waypoints>`; each may say its weather. In 2.x a route may
have `<scenarios><scenario name= type=><trigger_point x= y= z= yaw=/></scenario></scenarios>`, too.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.files.received import read_bytes
from di_envs.town.plan import PERCENTAGE, WEATHER_PARAMETERS
from di_envs.town.plan import RouteWeather as RouteWeather  # from here, too

Layout = Literal["1.0", "2.x"]


class RouteFileError(ValueError):
    """A route file that cannot be used; the message names the file and the place in it."""


class Keypoint(NamedTuple):
    """One waypoint of a route file: world frame (y south), angles as the file has them."""

    x: float  # m
    y: float
    z: float
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    yaw_deg: float = 0.0


class RouteScenario(NamedTuple):
    """A `<scenario>` of a route in 2.x: what happens, and the pose that triggers it."""

    name: str
    type: str  # CARLA's, such as DynamicObjectCrossing
    x: float  # m, world frame
    y: float
    z: float
    yaw_deg: float


@dataclass(frozen=True, kw_only=True)
class RouteSpec:
    """A route as its file describes it."""

    route_id: str
    town: str
    keypoints: tuple[Keypoint, ...]
    weathers: tuple[RouteWeather, ...] = ()
    scenarios: tuple[RouteScenario, ...] = ()

    @property
    def positions(self) -> NDArray[np.float64]:
        """(K, 3) x, y, z of the keypoints: all that the planner reads."""
        return np.array([keypoint[:3] for keypoint in self.keypoints], dtype=np.float64)


class BrokenRoute(NamedTuple):
    """A route of a file that cannot be read, beside others that can."""

    route_id: str
    town: str
    why: str


def read_routes(path: str | Path, broken: list[BrokenRoute] | None = None) -> list[RouteSpec]:
    """Reads a CARLA route file.

    Args:
        path: XML file; both layouts are understood, route by route.
        broken: Where given, routes that have an id and a town but are broken otherwise are put
            here and left out; else they are refused with the file.

    Returns:
        The routes in the order of the file; at least one.

    Raises:
        RouteFileError: If the file is missing, is no XML, holds no routes, or if a route lacks its
            id, its town or two keypoints, has a coordinate, a parameter of its weather or a place
            of a scenario that is no finite number, or has the id of an earlier route.
    """
    path = Path(path)
    routes: dict[str, RouteSpec] = {}
    for element in _root_of(path).iter("route"):
        try:
            route = _route(element, path)
        except RouteFileError as error:
            route_id, town = element.get("id"), element.get("town")
            if broken is None or not route_id or not town:
                raise
            broken.append(BrokenRoute(route_id, town, str(error)))
            continue
        if route.route_id in routes:
            raise RouteFileError(
                f"{path}: two routes have the id '{route.route_id}'; give each an id of its own."
            )
        routes[route.route_id] = route
    if not routes and broken:
        raise RouteFileError(broken[0].why)
    if not routes:
        raise RouteFileError(
            f"{path}: expected <route> elements as in CARLA's route files, found none."
        )
    return list(routes.values())


def write_routes(path: str | Path, routes: Iterable[RouteSpec], layout: Layout = "1.0") -> None:
    """Writes a CARLA route file that `read_routes` reads back unchanged.

    The 2.x layout has no angles, so they are lost there.

    Raises:
        RouteFileError: If there are no routes, or if two have one id.
    """
    routes = list(routes)
    ids = [route.route_id for route in routes]
    if not routes or len(set(ids)) < len(ids):
        raise RouteFileError(
            f"{path}: expected at least one route and a different id for each, got ids {ids}."
        )
    root = ET.Element("routes")
    for route in routes:
        element = ET.SubElement(root, "route", id=route.route_id, town=route.town)
        _write_weathers(element, route.weathers)
        _write_scenarios(element, route.scenarios)
        if layout == "2.x":
            element = ET.SubElement(element, "waypoints")
        for keypoint in route.keypoints:
            _write_keypoint(element, keypoint, layout)
    ET.indent(root, "  ")
    text = ET.tostring(root, encoding="unicode", xml_declaration=False)
    declaration = '<?xml version="1.0" encoding="UTF-8"?>\n'
    Path(path).write_text(f"{declaration}{text}\n", encoding="utf-8")


def _root_of(path: Path) -> ET.Element:
    try:
        return ET.fromstring(read_bytes(path))
    except FileNotFoundError:
        raise RouteFileError(f"{path}: there is no such route file; check the path.") from None
    except OSError as error:
        raise RouteFileError(f"{path}: the route file cannot be read: {error}.") from error
    except (ET.ParseError, ValueError, LookupError) as error:  # some of an odd encoding
        raise RouteFileError(
            f"{path}: expected CARLA route XML, but it is not well-formed: {error}."
        ) from error


def _route(element: ET.Element, path: Path) -> RouteSpec:
    route_id, town = element.get("id"), element.get("town")
    if not route_id or not town:
        raise RouteFileError(
            f"{path}: expected <route id=… town=…>, got attributes {dict(element.attrib)}."
        )
    where = f"{path}: route '{route_id}'"
    points = element.findall("waypoint") or element.findall("waypoints/position")
    if len(points) < 2:
        raise RouteFileError(
            f"{where} has {len(points)} keypoints; expected at least two "
            "<waypoint> or <waypoints><position> elements, a start and an end."
        )
    return RouteSpec(
        route_id=route_id,
        town=town,
        keypoints=tuple(_keypoint(point, where) for point in points),
        weathers=tuple(_weather(weather, where) for weather in element.iter("weather")),
        scenarios=tuple(_scenario(scenario, where) for scenario in element.iter("scenario")),
    )


def _keypoint(element: ET.Element, where: str) -> Keypoint:
    place = [_number(element, key, where) for key in "xyz"]
    angles = [_number(element, key, where, "0") for key in ("pitch", "roll", "yaw")]
    return Keypoint(*place, *angles)


def _number(element: ET.Element, key: str, where: str, default: str | None = None) -> float:
    text = element.get(key, default)
    try:
        value = float(text if text is not None else "missing")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RouteFileError(
            f"{where}: expected a finite number for '{key}' of <{element.tag}>, got {text!r}."
        )
    return value


def _weather(element: ET.Element, where: str) -> RouteWeather:
    parameters = {key: _number(element, key, where) for key in element.attrib if _counts(key)}
    return RouteWeather(name=element.get("id", ""), parameters=parameters)


def _counts(key: str) -> bool:
    """Whether an attribute of a weather is a number to CARLA."""
    return key == PERCENTAGE or key in WEATHER_PARAMETERS


def _scenario(element: ET.Element, where: str) -> RouteScenario:
    kind, trigger = element.get("type"), element.find("trigger_point")
    if not kind or trigger is None:
        raise RouteFileError(
            f"{where}: expected <scenario name=… type=…><trigger_point x=… y=… z=… yaw=…/>, got "
            f"attributes {dict(element.attrib)} around {[child.tag for child in element]}."
        )
    x, y, z = (_number(trigger, key, where) for key in "xyz")
    yaw_deg = _number(trigger, "yaw", where, "0")  # CARLA's default
    return RouteScenario(element.get("name", ""), kind, x, y, z, yaw_deg)


def _write_weathers(route: ET.Element, weathers: Iterable[RouteWeather]) -> None:
    weathers = list(weathers)
    parent = route if len(weathers) == 1 else None
    for weather in weathers:
        parent = ET.SubElement(route, "weathers") if parent is None else parent
        element = ET.SubElement(parent, "weather")
        if weather.name:
            element.set("id", weather.name)
        for key, value in weather.parameters.items():
            element.set(key, repr(float(value)))


def _write_scenarios(route: ET.Element, scenarios: Iterable[RouteScenario]) -> None:
    parent = None
    for scenario in scenarios:
        parent = ET.SubElement(route, "scenarios") if parent is None else parent
        element = ET.SubElement(parent, "scenario", name=scenario.name, type=scenario.type)
        values = zip(("x", "y", "z", "yaw"), scenario[2:], strict=True)
        ET.SubElement(element, "trigger_point", {key: repr(float(value)) for key, value in values})


def _write_keypoint(parent: ET.Element, keypoint: Keypoint, layout: Layout) -> None:
    keys = ("x", "y", "z", "pitch", "roll", "yaw") if layout == "1.0" else ("x", "y", "z")
    element = ET.SubElement(parent, "waypoint" if layout == "1.0" else "position")
    for key, value in zip(keys, keypoint, strict=False):
        element.set(key, repr(float(value)))
