"""Weather: CARLA's presets as a handful of numbers, and the light that they give a scene.

Source: `carla.WeatherParameters` of CARLA 0.9.16 (cloudiness, precipitation, deposits, fog, wetness
in percent, sun altitude in degrees); CARLA gives them no azimuth that tells them apart, so the sun
stands in the south-west here. How they look is our own approximation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.files.names import check_name
from di_envs.numerics.bundles import by_reference

SUN_AZIMUTH_RAD = math.radians(125.0)  # in the world frame: where the sun stands


@dataclass(frozen=True, kw_only=True)
class Weather:
    """CARLA's weather parameters, in its units.

    Attributes:
        cloudiness: 0..100.
        precipitation: 0..100, how hard it rains.
        deposits: 0..100, puddles on the road.
        sun_altitude_deg: -90..90; below 0 it is night.
        fog: 0..100, fog density.
        wetness: 0..100, how wet the road is.
        dust: 0..100.
    """

    cloudiness: float = 0.0
    precipitation: float = 0.0
    deposits: float = 0.0
    sun_altitude_deg: float = 45.0
    fog: float = 0.0
    wetness: float = 0.0
    dust: float = 0.0


def _weather(clouds: float, rain: float, pools: float, sun: float, fog: float) -> Weather:
    return Weather(
        cloudiness=clouds,
        precipitation=rain,
        deposits=pools,
        sun_altitude_deg=sun,
        fog=fog,
        wetness=max(pools, rain),
    )


PRESETS = {
    "ClearNoon": _weather(5, 0, 0, 45, 2),
    "ClearSunset": _weather(5, 0, 0, 15, 2),
    "CloudyNoon": _weather(60, 0, 0, 45, 3),
    "CloudySunset": _weather(60, 0, 0, 15, 3),
    "WetNoon": _weather(5, 0, 50, 45, 3),
    "WetSunset": _weather(5, 0, 50, 15, 2),
    "MidRainyNoon": _weather(60, 60, 60, 45, 3),
    "MidRainSunset": _weather(60, 60, 60, 15, 3),
    "WetCloudyNoon": _weather(60, 0, 50, 45, 3),
    "WetCloudySunset": _weather(60, 0, 50, 15, 2),
    "HardRainNoon": _weather(100, 100, 90, 45, 7),
    "HardRainSunset": _weather(100, 100, 90, 15, 7),
    "SoftRainNoon": _weather(20, 30, 50, 45, 3),
    "SoftRainSunset": _weather(20, 30, 50, 15, 2),
    "ClearNight": _weather(5, 0, 0, -90, 60),
    "CloudyNight": _weather(60, 0, 0, -90, 60),
    "WetNight": _weather(5, 0, 50, -90, 60),
    "WetCloudyNight": _weather(60, 0, 50, -90, 60),
    "SoftRainNight": _weather(60, 30, 50, -90, 60),
    "MidRainyNight": _weather(80, 60, 60, -90, 60),
    "HardRainNight": _weather(100, 100, 90, -90, 100),
    "DustStorm": Weather(cloudiness=100, sun_altitude_deg=45, fog=2, dust=100),
    "Default": Weather(cloudiness=30, sun_altitude_deg=70),  # of Leaderboard 1.0's routes
}


@by_reference
class Look(NamedTuple):
    """How a weather looks, as cameras need it. Colours are shares of full brightness."""

    sun: NDArray[np.float32]  # (3,) towards the sun
    sun_colour: NDArray[np.float32]  # (3,) light on a face turned to the sun
    ambient: NDArray[np.float32]  # (3,) light from everywhere
    zenith: NDArray[np.float32]  # (3,) sky above
    horizon: NDArray[np.float32]  # (3,) sky at the horizon, and of what haze hides
    haze: float  # 1/m
    shadow: float  # 0..1: share of the sun that a shadow takes away
    wetness: float  # 0..1, of roads
    puddles: float  # 0..1
    rain: float  # 0..1
    window_glow: float  # 0..1
    night: int  # 1 when headlights shine


def weather_of(weather: str | Weather) -> Weather:
    """A weather, or the preset of a name.

    Raises:
        ValueError: If there is no such preset; suggests one.
    """
    if isinstance(weather, Weather):
        return weather
    check_name(weather, PRESETS, "weather")
    return PRESETS[weather]


def look_of(weather: Weather) -> Look:
    """The light of a weather."""
    cloud = weather.cloudiness / 100.0
    rain = weather.precipitation / 100.0
    night = weather.sun_altitude_deg < 0.0
    altitude = math.radians(max(weather.sun_altitude_deg, 8.0) if not night else 40.0)
    flat = math.cos(altitude)
    sun = (
        flat * math.cos(SUN_AZIMUTH_RAD),
        flat * math.sin(SUN_AZIMUTH_RAD),
        math.sin(altitude),
    )
    low = max(0.0, 1.0 - weather.sun_altitude_deg / 40.0) if not night else 0.0  # sunset, 0..1
    clear_sun = np.array([1.0, 0.96 - 0.24 * low, 0.88 - 0.48 * low])
    direct = (1.0 - 0.85 * cloud) * (0.85 + 0.35 * low)
    shade = np.array([0.50, 0.53, 0.58]) * (1.0 + 0.35 * cloud) * (1.0 - 0.15 * low)
    grey = np.array([0.66, 0.68, 0.71]) * (1.0 - 0.28 * low - 0.22 * rain)
    zenith = _mix(np.array([0.27, 0.47, 0.77]) * (1.0 - 0.35 * low), grey * 0.92, cloud)
    bright = _mix(np.array([0.76, 0.84, 0.92]), np.array([0.96, 0.68, 0.45]), low)
    horizon = _mix(bright, grey * np.array([1.05, 1.03, 1.0]), 0.9 * cloud)
    shade = shade * (1.0 - 0.20 * rain)
    if weather.dust > 0.0:
        share = weather.dust / 100.0
        tan = np.array([0.76, 0.60, 0.40])
        zenith, horizon = _mix(zenith, tan, 0.9 * share), _mix(horizon, tan, share)
        shade = shade * _mix(np.ones(3), np.array([1.0, 0.85, 0.62]), share)
    if night:
        direct = 0.04
        shade = np.array([0.15, 0.15, 0.17]) * (1.0 - 0.2 * cloud)
        zenith = np.array([0.012, 0.018, 0.045]) + 0.02 * cloud
        horizon = np.array([0.055, 0.060, 0.085]) + 0.02 * cloud
    haze = 1.0 / 700.0 + rain / 260.0 + weather.dust / 100.0 / 45.0
    haze += weather.fog / 100.0 / (300.0 if night else 60.0)
    return Look(
        sun=np.array(sun, np.float32),
        sun_colour=(clear_sun * direct).astype(np.float32),
        ambient=shade.astype(np.float32),
        zenith=zenith.astype(np.float32),
        horizon=np.minimum(horizon, 1.0).astype(np.float32),
        haze=_single(haze),
        shadow=_single(0.0 if night else 0.92 * (1.0 - 0.75 * cloud)),
        wetness=_single(max(weather.wetness, weather.precipitation) / 100.0),
        puddles=_single(weather.deposits / 100.0),
        rain=_single(rain),
        window_glow=_single(0.6 if night else 0.0),
        night=int(night),
    )


def _single(value: float) -> float:
    """A number of no more than single precision, as colours are."""
    return float(np.float32(value))


def _mix(a: NDArray[np.float64], b: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    return a * (1.0 - share) + b * share
