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

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from di_envs.files.json_text import JsonError, indented, read_json
from di_envs.files.json_values import from_json
from di_envs.files.whole import write_whole

NUMBERS = range(1, 11)  # of the Leaderboard 1.0's scenarios
_NUMBER_OF = {f"Scenario{number}": number for number in NUMBERS}


class TriggerFileError(ValueError):
    """A trigger file that cannot be used; the message names the file and the place in it."""


class PlacedScenario(NamedTuple):
    """A scenario and the pose that triggers it: world frame (y south), yaw clockwise."""

    number: int  # the Leaderboard 1.0's, 1 to 10
    x: float  # m
    y: float
    z: float
    yaw_rad: float


# A file's objects, as far as they are read


@dataclass(frozen=True, kw_only=True)
class _Transform:
    x: float | str  # some files hold numbers as strings
    y: float | str
    z: float | str
    yaw: float | str

    def __post_init__(self) -> None:
        for key, value in vars(self).items():
            if not math.isfinite(_number(value)):
                raise ValueError(f"expected a finite number for '{key}', got {value!r}")


@dataclass(frozen=True, kw_only=True)
class _Event:
    transform: _Transform


@dataclass(frozen=True, kw_only=True)
class _Scenario:
    scenario_type: str
    available_event_configurations: tuple[_Event, ...]

    def __post_init__(self) -> None:
        if self.scenario_type not in _NUMBER_OF:
            raise ValueError(
                f"unknown scenario type {self.scenario_type!r}; the Leaderboard 1.0 has Scenario1 "
                f"to Scenario{NUMBERS[-1]}. Files for Leaderboard 2.x list scenarios in the route "
                "file"
            )


@dataclass(frozen=True, kw_only=True)
class _File:
    available_scenarios: tuple[Mapping[str, tuple[_Scenario, ...]], ...]


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
        for town, scenarios in _towns(path):
            if town.casefold() in names:
                placed.extend(_placed(scenarios))
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
    write_whole(path, indented(content))


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


def _towns(path: Path) -> Iterator[tuple[str, tuple[_Scenario, ...]]]:
    """Each town with its scenarios."""
    try:
        file = from_json(_File, read_json(path), str(path), foreign=True)
    except JsonError as error:
        raise TriggerFileError(
            f"{error}. Expected is CARLA's trigger JSON, "
            '{"available_scenarios": [{"Town05": [...]}]}.'
        ) from error
    for towns in file.available_scenarios:
        yield from towns.items()


def _placed(scenarios: Iterable[_Scenario]) -> Iterator[PlacedScenario]:
    for scenario in scenarios:
        for event in scenario.available_event_configurations:
            at = event.transform
            x, y, z, yaw_deg = (_number(value) for value in (at.x, at.y, at.z, at.yaw))
            number = _NUMBER_OF[scenario.scenario_type]
            yield PlacedScenario(number, x, y, z, math.radians(yaw_deg))


def _number(value: float | str) -> float:
    try:
        return float(value)
    except ValueError:
        return math.nan


def _text(paths: Path | Sequence[Path]) -> str:
    return ", ".join(map(str, [paths] if isinstance(paths, Path) else paths))
