"""The weather that a route file asks for: one, or keyframes along the route with all in between.

A function of how much of the route is done, so a world that is restored or replayed looks the same.

Source: behaviour of `RouteWeatherBehavior` in `srunner/scenariomanager/weather_sim.py` (CARLA
ScenarioRunner, MIT licence) and of `leaderboard/utils/route_parser.py` (CARLA Leaderboard 1.0 and
2.0, MIT licence); our own code. Parameters that `Weather` has not, such as wind, are not read.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from di_envs.sensors.weather import PRESETS, Weather
from di_envs.town.plan import PERCENTAGE, RouteWeather

# Our field by CARLA's parameter, with its range
_FIELDS = {
    "cloudiness": ("cloudiness", 0.0),
    "precipitation": ("precipitation", 0.0),
    "precipitation_deposits": ("deposits", 0.0),
    "sun_altitude_angle": ("sun_altitude_deg", -90.0),
    "fog_density": ("fog", 0.0),
    "wetness": ("wetness", 0.0),
    "dust_storm": ("dust", 0.0),
}
_MOST = {"sun_altitude_angle": 90.0}  # 100 percent for all others
# What a parameter is that a file leaves out, in 1.0 and in 2.x
_BASE_1 = Weather(sun_altitude_deg=0.0)
_BASE_2 = Weather(sun_altitude_deg=70.0, cloudiness=50.0)
NOTHING_SAID = PRESETS["ClearNoon"]


class Keyframe(NamedTuple):
    """A weather, and the percent of the route at which it is reached."""

    percent: float
    weather: Weather


def keyframes_of(weathers: Iterable[RouteWeather]) -> tuple[Keyframe, ...]:
    """The keyframes of a route, in the order in which they are reached; one where none is said."""
    frames = [
        Keyframe(each.parameters.get(PERCENTAGE, 0.0), weather_said(each)) for each in weathers
    ]
    return tuple(sorted(frames, key=lambda frame: frame.percent)) or (Keyframe(0.0, NOTHING_SAID),)


def weather_said(said: RouteWeather) -> Weather:
    """A `<weather>`: its parameters over the preset that its id names, or over CARLA's base."""
    base = _BASE_2 if PERCENTAGE in said.parameters else _BASE_1
    if says_nothing(said):
        base = PRESETS["Default"]
    changes = {
        field: min(max(said.parameters[key], least), _MOST.get(key, 100.0))
        for key, (field, least) in _FIELDS.items()
        if key in said.parameters
    }
    return dataclasses.replace(_preset(said.name) or base, **changes)


def says_nothing(said: RouteWeather) -> bool:
    """Whether a `<weather>` has no parameters, and no id that is a preset's."""
    return not said.parameters and _preset(said.name) is None


def _preset(name: str) -> Weather | None:
    by_name = {known.casefold(): weather for known, weather in PRESETS.items()}
    return by_name.get(name.casefold())


def weather_at(frames: Sequence[Keyframe], percent: float) -> Weather:
    """The weather after so many percent of a route: linear between keyframes, and the nearest one
    before the first and after the last."""
    if percent <= frames[0].percent:
        return frames[0].weather
    for before, after in pairwise(frames):
        if percent <= after.percent:
            share = (percent - before.percent) / (after.percent - before.percent)
            return _between(before.weather, after.weather, share)
    return frames[-1].weather


def _between(a: Weather, b: Weather, share: float) -> Weather:
    values = dataclasses.asdict(a)
    ends = dataclasses.asdict(b)
    return Weather(**{name: y + (ends[name] - y) * share for name, y in values.items()})


def keyframes_text(frames: Iterable[Keyframe]) -> str:
    """Keyframes as a record has them: `0 %: cloudiness 5, sun_altitude_deg 45; 100 %: …`."""
    return "; ".join(f"{frame.percent:g} %: {_text(frame.weather)}" for frame in frames)


def _text(weather: Weather) -> str:
    name = next((name for name, preset in PRESETS.items() if preset == weather), "")
    values = dataclasses.asdict(weather).items()
    return name or ", ".join(f"{field} {value:g}" for field, value in values if value)
