"""Weather: presets by name, and looks that differ."""

from __future__ import annotations

import numpy as np
import pytest

from di_envs.config import WEATHERS
from di_envs.sensors.weather import PRESETS, Weather, look_of, weather_of
from tests.carla_wheel import carla_wheel


def test_the_presets_are_those_that_options_know():
    assert set(PRESETS) == set(WEATHERS)


def test_presets_hold_carlas_own_numbers():
    carla = carla_wheel()
    for name, weather in PRESETS.items():
        if name == "Default":  # CARLA's own means "leave it as the map has it"
            continue
        theirs = getattr(carla.WeatherParameters, name)
        assert weather.cloudiness == theirs.cloudiness, name
        assert weather.precipitation == theirs.precipitation, name
        assert weather.deposits == theirs.precipitation_deposits, name
        assert weather.sun_altitude_deg == theirs.sun_altitude_angle, name


def test_an_unknown_weather_is_refused_with_a_suggestion():
    with pytest.raises(ValueError, match=r"'ClearNoom'; did you mean 'ClearNoon'\?"):
        weather_of("ClearNoom")


def test_a_weather_of_ones_own_is_taken_as_it_is():
    mine = Weather(fog=80.0)
    assert weather_of(mine) is mine


@pytest.mark.parametrize("name", PRESETS)
def test_every_look_is_finite_and_within_what_an_image_can_show(name):
    look = look_of(PRESETS[name])
    for name, part in look._asdict().items():
        assert np.array_equal(np.asarray(part, np.float32), part), name  # of single precision
        assert np.isfinite(part).all()
        assert np.min(part) >= (-1.0 if name == "sun" else 0.0), name
    assert np.linalg.norm(look.sun) == pytest.approx(1.0, abs=1e-6)
    assert (look.horizon <= 1.0).all()


def test_more_fog_hides_more_and_more_cloud_takes_the_shadows():
    assert look_of(Weather(fog=60)).haze > 3 * look_of(Weather(fog=5)).haze
    assert look_of(Weather(cloudiness=90)).shadow < look_of(Weather()).shadow / 2


def test_the_night_is_darker_than_the_day():
    night, day = look_of(PRESETS["ClearNight"]), look_of(PRESETS["ClearNoon"])
    assert (night.ambient < day.ambient / 2).all()
    assert (night.zenith < day.zenith / 5).all()
