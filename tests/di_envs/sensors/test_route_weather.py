"""The weather of route files: CARLA's parameters, keyframes, and the same bits after a restore."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from di_envs.route_env import RouteEnv
from di_envs.saving import restore, save
from di_envs.sensors.route_weather import (
    Keyframe,
    keyframes_of,
    keyframes_text,
    says_nothing,
    weather_at,
    weather_said,
)
from di_envs.sensors.weather import PRESETS, Weather
from di_envs.town.plan import RouteWeather

DRY, WET = Weather(sun_altitude_deg=60.0), Weather(sun_altitude_deg=20.0, precipitation=80.0)
GO = np.array([0.6, 0.0, 0.0], np.float32)
CHANGING = """<routes><route id="a" town="toy"><weathers>
<weather route_percentage="0" cloudiness="0" sun_altitude_angle="60"/>
<weather route_percentage="100" cloudiness="100" sun_altitude_angle="10" precipitation="90"/>
</weathers><waypoints><position x="-60" y="55.25" z="0"/><position x="-20" y="55.25" z="0"/>
</waypoints></route></routes>"""


def said(name: str = "", **parameters: float) -> RouteWeather:
    return RouteWeather(name=name, parameters=parameters)


def test_parameters_are_carlas_over_the_preset_of_the_name_or_carlas_base() -> None:
    assert weather_said(said("HardRainNoon")) == PRESETS["HardRainNoon"]
    assert weather_said(said("hardrainnoon")) == PRESETS["HardRainNoon"]
    changed = weather_said(said("ClearNoon", fog_density=30.0))
    assert (changed.fog, changed.cloudiness) == (30.0, 5.0)
    # 1.0 begins at zeros, 2.x at a sun of 70 degrees and half a sky of clouds
    assert weather_said(said("custom", cloudiness=30.0)) == Weather(
        cloudiness=30.0, sun_altitude_deg=0.0
    )
    assert weather_said(said(route_percentage=0.0, wetness=9.0)) == Weather(
        sun_altitude_deg=70.0, cloudiness=50.0, wetness=9.0
    )
    beyond = weather_said(said(cloudiness=140.0, sun_altitude_angle=-400.0, wind_intensity=5.0))
    assert beyond == Weather(cloudiness=100.0, sun_altitude_deg=-90.0)


def test_a_weather_that_says_nothing_known_is_carlas_default() -> None:
    assert says_nothing(said("Spring"))
    assert weather_said(said("Spring")) == PRESETS["Default"]
    assert not says_nothing(said("Spring", cloudiness=1.0))
    assert not says_nothing(said("ClearNoon"))


def test_between_keyframes_weather_is_linear_and_the_nearest_beyond_them() -> None:
    frames = [Keyframe(20.0, DRY), Keyframe(60.0, WET)]
    assert [weather_at(frames, percent) for percent in (0.0, 20.0)] == [DRY, DRY]
    middle = Weather(sun_altitude_deg=50.0, precipitation=20.0)  # a quarter of the way
    assert weather_at(frames, 30.0) == middle
    assert [weather_at(frames, percent) for percent in (60.0, 100.0)] == [WET, WET]


def test_keyframes_are_sorted_and_two_at_one_place_change_at_once() -> None:
    frames = keyframes_of(
        [
            said("WetNoon", route_percentage=50.0),
            said("ClearNoon", route_percentage=0.0),
            said("HardRainNoon", route_percentage=50.0),
        ]
    )
    assert [frame.percent for frame in frames] == [0.0, 50.0, 50.0]
    assert weather_at(frames, 50.0) == PRESETS["WetNoon"]
    assert weather_at(frames, 50.1) == PRESETS["HardRainNoon"]
    assert keyframes_text(frames) == "0 %: ClearNoon; 50 %: WetNoon; 50 %: HardRainNoon"
    assert keyframes_of([]) == (Keyframe(0.0, PRESETS["ClearNoon"]),)


@pytest.fixture
def changing(tmp_path: Path) -> str:
    path = tmp_path / "changing.xml"
    path.write_text(CHANGING, encoding="utf-8")
    return str(path)


def made(routes: str, **options: object) -> RouteEnv:
    return RouteEnv(
        town="toy",
        routes=routes,
        cameras="rl",
        observations=("camera",),
        traffic=0,
        walkers=0,
        **options,
    )


def brightness(env: RouteEnv, steps: int) -> list[float]:
    return [float(env.step(GO)[0]["camera_front"].mean()) for _ in range(steps)]


def test_cameras_see_the_weather_change_along_the_route_and_physics_do_not(changing: str) -> None:
    env, clear = made(changing), made(changing, weather="ClearNoon")
    assert (env.config.weather, clear.config.weather) == ("route", "ClearNoon")
    for each in (env, clear):
        each.reset(seed=3)
    seen, still = brightness(env, 40), brightness(clear, 40)
    assert env.view.state.route_index[0] > 10
    assert seen[-1] < still[-1] - 8.0  # of 255: grey, with a low sun, by then
    assert seen[0] > still[0]
    np.testing.assert_array_equal(env.view.state.x, clear.view.state.x)


def test_a_restored_world_looks_the_same_to_the_bit_whatever_was_seen_between(
    changing: str,
) -> None:
    env, other = made(changing), made(changing)
    env.reset(seed=3)
    brightness(env, 25)
    kept = save(env)
    first = [env.step(GO)[0]["camera_front"] for _ in range(10)]
    env.change_weather("ClearNight")
    restore(env, kept)
    again = [env.step(GO)[0]["camera_front"] for _ in range(10)]
    other.reset(seed=9)
    restore(other, kept)
    elsewhere = [other.step(GO)[0]["camera_front"] for _ in range(10)]
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(first, elsewhere)
    assert (first[0] != first[-1]).any()
