"""Radars by configuration: how they are turned, by hand; what is refused, and with which words."""

from __future__ import annotations

import math

import numpy as np
import pytest

from di_envs.config import RouteEnvConfig
from di_envs.observation import observation_space
from di_envs.sensors.radar.config import MOST_RADARS, RadarConfig, checked_radars

RIGHT = math.pi / 2.0


@pytest.mark.parametrize(
    ("turned", "ahead", "right"),
    [
        ({}, (1, 0, 0), (0, 1, 0)),
        ({"yaw_rad": RIGHT}, (0, 1, 0), (-1, 0, 0)),
        ({"pitch_rad": RIGHT}, (0, 0, 1), (0, 1, 0)),
        ({"roll_rad": RIGHT}, (1, 0, 0), (0, 0, -1)),  # its right side down
        ({"yaw_rad": RIGHT, "pitch_rad": RIGHT}, (0, 0, 1), (-1, 0, 0)),
    ],
)
def test_a_radar_looks_where_its_angles_say(turned, ahead, right):
    """Columns are the radar's own axes in the ego's frame: ahead, right, up."""
    turn = RadarConfig(name="radar", **turned).ego_from_radar()
    np.testing.assert_allclose(turn[:, 0], ahead, atol=1e-12)
    np.testing.assert_allclose(turn[:, 1], right, atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)


def test_a_tick_has_a_twentieth_of_the_points_of_a_second():
    assert RadarConfig(name="radar").rays == 75
    radars = (RadarConfig(name="a"), RadarConfig(name="b", points_per_s=200))
    space = observation_space(("radar", "proximity"), radars=radars)
    assert {name: part.shape for name, part in space.items()} == {
        "a": (75, 4), "b": (10, 4), "contacts": (8, 4), "obstacle": (3,), "across_line": (1,)
    }  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"fov_deg": 180.0}, "cone of 0 to 180 degrees"),
        ({"range_m": 0.0}, "0 to 200 m far"),
        ({"points_per_s": 19}, "20 to 1,000,000 points"),
        ({"x_m": math.nan}, "x_m must be a finite number"),
    ],
)
def test_an_impossible_radar_is_refused(changes, says):
    with pytest.raises(ValueError, match=says):
        RadarConfig(name="radar", **changes)


def test_radars_have_names_of_their_own_and_are_not_too_many():
    with pytest.raises(ValueError, match="names of their own"):
        checked_radars([RadarConfig(name="a"), RadarConfig(name="a")])
    with pytest.raises(ValueError, match=f"1 to {MOST_RADARS} radars"):
        checked_radars([])
    with pytest.raises(ValueError, match=r"RadarConfigs; got \['front'\]"):
        RouteEnvConfig(suite="toy", radars=("front",))


@pytest.mark.parametrize("origin", [(86.0, 0.0), (0.0, 181.0), (0.0,), "49,8", (math.nan, 0.0)])
def test_an_origin_that_is_no_place_is_refused(origin):
    with pytest.raises(ValueError, match="A map's origin is its latitude"):
        RouteEnvConfig(suite="toy", gnss_origin=origin)
