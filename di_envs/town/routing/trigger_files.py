"""CARLA's trigger files: where the Leaderboard's scenarios may begin; reading and writing them.

A trigger file is JSON. The Leaderboard 1.0 keeps all towns in one, TransFuser and others one a town
and scenario; both have this layout:

    {"available_scenarios": [{"Town05": [
      {"scenario_type": "Scenario3", "available_event_configurations": [
        {"transform": {"x": 30.1, "y": -64.0, "z": 0.0, "pitch": 0.0, "yaw": 90.0}}]}]}]}

`other_actors`, which may stand beside a transform, is not read: the scenarios that are staged here
find their places without it in the Leaderboard too.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

NUMBERS = range(1, 11)  # of the Leaderboard 1.0's scenarios


class TriggerFileError(ValueError):
    """A trigger file that cannot be used; the message names the file and the place in it."""


class PlacedScenario(NamedTuple):
    """A scenario and the pose that triggers it: world frame (y south), yaw clockwise."""

    number: int  # the Leaderboard 1.0's, 1 to 10
    x: float  # m
    y: float
    z: float
    yaw_rad: float


def read_triggers(
    paths: Path | Sequence[Path], towns: Collection[str]
) -> tuple[PlacedScenario, ...]:
    """Reads the scenarios that are placed in a town.

    Args:
        paths: Files, or folders whose `*.json` files are taken in the order of their names.
        towns: Names of the town, in any case; several where the map and the routes differ.

    Returns:
        The scenarios in the order of the files, which decides between equals on a route.

    Raises:
        TriggerFileError: If a path is missing, a folder holds no JSON file, a file is no trigger
            file, names an unknown scenario or a place that is no number, or if no scenario at all
            is placed in the town while there are some elsewhere.
    """
    placed: list[PlacedScenario] = []
    others: dict[str, None] = {}
    names = {town.casefold() for town in towns}
    for path in _files([paths] if isinstance(paths, Path) else paths):
        for town, scenarios, where in _towns(_content(path), path):
            if town.casefold() in names:
                placed.extend(_scenarios(scenarios, where))
            else:
                others[town] = None
    if not placed and others:
        raise TriggerFileError(
            f"{_text(paths)}: no scenario is placed in {' or '.join(sorted(towns))}; "
            f"its towns: {', '.join(sorted(others))}."
        )
    return tuple(placed)


def write_triggers(path: Path, town: str, placed: Iterable[PlacedScenario]) -> None:
    """Writes a trigger file of one town, by number and then as given."""
    by_number: dict[int, list[PlacedScenario]] = {}
    for place in placed:
        by_number.setdefault(place.number, []).append(place)
    scenarios = [
        {
            "scenario_type": f"Scenario{number}",
            "available_event_configurations": [
                {"transform": _transform(place)} for place in by_number[number]
            ],
        }
        for number in sorted(by_number)
    ]
    content = {"available_scenarios": [{town: scenarios}]}
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def _transform(place: PlacedScenario) -> dict[str, float]:
    yaw_deg = math.degrees(place.yaw_rad) % 360.0
    x, y, z, yaw = (round(value, 3) for value in (place.x, place.y, place.z, yaw_deg))
    return {"x": x, "y": y, "z": z, "pitch": 0.0, "yaw": yaw}


def _files(paths: Sequence[Path]) -> Iterator[Path]:
    for path in paths:
        if path.is_dir():
            inside = sorted(path.glob("*.json"))
            if not inside:
                raise TriggerFileError(f"{path}: the folder holds no trigger file (*.json).")
            yield from inside
        elif path.is_file():
            yield path
        else:
            raise TriggerFileError(f"{path}: there is no such trigger file or folder.")


def _content(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise TriggerFileError(
            f"{path}: expected CARLA's trigger JSON, but it is not JSON: {error}."
        ) from error
    except OSError as error:
        raise TriggerFileError(f"{path}: the trigger file cannot be read: {error}.") from error


def _towns(content: Any, path: Path) -> Iterator[tuple[str, list[Any], str]]:
    """Each town's list of scenarios, and where it stands."""
    listed = content.get("available_scenarios") if isinstance(content, dict) else None
    if not isinstance(listed, list) or not all(isinstance(towns, dict) for towns in listed):
        raise TriggerFileError(
            f"{path}: expected CARLA's trigger JSON, "
            '{"available_scenarios": [{"Town05": [...]}]}; '
            f"got {_shape(content)}."
        )
    for towns in listed:
        for town, scenarios in towns.items():
            where = f"{path}: town '{town}'"
            if not isinstance(scenarios, list):
                raise TriggerFileError(f"{where}: expected a list of scenarios, got {scenarios!r}.")
            yield town, scenarios, where


def _scenarios(scenarios: list[Any], where: str) -> Iterator[PlacedScenario]:
    for scenario in scenarios:
        number = _number(scenario, where)
        events = scenario.get("available_event_configurations")
        if not isinstance(events, list):
            raise TriggerFileError(
                f"{where}: Scenario{number} needs a list 'available_event_configurations', "
                f"got {_shape(events)}."
            )
        for i, event in enumerate(events):
            yield _placed(number, event, f"{where}: Scenario{number}, event configuration {i}")


def _number(scenario: Any, where: str) -> int:
    name = scenario.get("scenario_type") if isinstance(scenario, dict) else None
    known = {f"Scenario{number}": number for number in NUMBERS}
    if name not in known:
        raise TriggerFileError(
            f"{where}: unknown scenario type {name!r}; the Leaderboard 1.0 has Scenario1 to "
            f"Scenario{NUMBERS[-1]}. Files for Leaderboard 2.x list scenarios in the route file."
        )
    return known[name]


def _placed(number: int, event: Any, where: str) -> PlacedScenario:
    transform = event.get("transform") if isinstance(event, dict) else None
    if not isinstance(transform, dict):
        raise TriggerFileError(f"{where}: expected a 'transform' with x, y, z, yaw, got {event!r}.")
    x, y, z, yaw_deg = (_value(transform, key, where) for key in ("x", "y", "z", "yaw"))
    return PlacedScenario(number, x, y, z, math.radians(yaw_deg))


def _value(transform: dict[str, Any], key: str, where: str) -> float:
    try:
        value = float(transform[key])  # some files hold numbers as strings
    except (KeyError, TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise TriggerFileError(
            f"{where}: expected a finite number for '{key}', got {transform.get(key)!r}."
        )
    return value


def _shape(content: Any) -> str:
    """What was found instead, in a few words."""
    if isinstance(content, dict):
        return f"an object with {', '.join(map(repr, list(content)[:5])) or 'nothing in it'}"
    return "nothing" if content is None else f"a {type(content).__name__}"


def _text(paths: Path | Sequence[Path]) -> str:
    return ", ".join(map(str, [paths] if isinstance(paths, Path) else paths))
