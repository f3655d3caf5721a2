"""IMU and GNSS: axes and noise by arithmetic, geodesy against the formula run backwards."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats

from di_envs.sensors.inertial import (
    EARTH_RADIUS_M,
    fill_gnss,
    fill_imu,
    geodetic,
)
from di_envs.town.lanes import LaneKind
from di_envs.town.loading import load_town
from di_envs.world.state import Capacity, state_dtype, views_of


def state_of(tick=0, seed=1, **values):
    """One ego at the origin, standing, facing east, but for the values given."""
    state = views_of(np.zeros(1, state_dtype(Capacity(1, 0, 0, 0, 0, 0))))
    for name, value in {"tick": tick, "seed": seed, **values}.items():
        getattr(state, name)[...] = value
    return state


@functools.cache
def town_lanes():
    return load_town("town05").lanes


def imu(**values):
    """On no lane unless one is given, so level."""
    out = np.zeros(7, np.float32)
    fill_imu(state_of(**{"lane": -1} | values), town_lanes(), 0, out)
    return out


def gnss(origin=(0.0, 0.0), **values):
    out = np.zeros(3)
    fill_gnss(state_of(**values), 0, *origin, out)
    return out


def test_a_car_at_rest_feels_gravity_alone():
    np.testing.assert_allclose(imu()[:6], [0, 0, 9.81, 0, 0, 0], atol=0.1)


def test_a_right_turn_pulls_to_the_right_by_speed_times_yaw_rate():
    out = imu(speed=10.0, yaw_rate=0.5, acceleration=2.0)
    assert out[0] == pytest.approx(2.0, abs=0.01)
    assert out[1] == pytest.approx(5.0, abs=0.01)
    assert out[5] == pytest.approx(0.5, abs=0.01)


def ramp():
    """The lane of the town that rises most, how much, and where: station, yaw."""
    lanes = town_lanes()
    rise = np.diff(lanes.points[:, 2]) / np.repeat(lanes.spacing_m, lanes.count)[:-1]
    rise[lanes.point_lane[1:] != lanes.point_lane[:-1]] = 0.0
    rise[lanes.kind[lanes.point_lane[1:]] != LaneKind.DRIVING] = 0.0
    point = int(rise.argmax())
    lane = int(lanes.point_lane[point])
    station = (point + 0.5 - lanes.first[lane]) * lanes.spacing_m[lane]
    return lane, float(rise[point]), float(station), float(lanes.points[point, 3])


@pytest.mark.parametrize(
    ("turn", "ahead", "right"),
    [(0.0, 1.0, 0.0), (math.pi, -1.0, 0.0), (math.pi / 2, 0.0, -1.0), (-math.pi / 2, 0.0, 1.0)],
)
def test_on_a_ramp_a_part_of_gravity_lies_along_the_road(turn, ahead, right):
    """At rest the reading points straight up: uphill, to whichever side of the car that is."""
    lane, rise, station, yaw = ramp()
    assert rise > 0.03
    out = imu(lane=lane, lane_m=station, yaw=yaw + turn)
    pitch = math.atan(rise)
    assert out[0] == pytest.approx(9.81 * math.sin(pitch) * ahead, abs=0.01)
    assert out[1] == pytest.approx(9.81 * math.sin(pitch) * right, abs=0.01)
    assert out[2] == pytest.approx(9.81 * math.cos(pitch), abs=0.07)
    assert np.linalg.norm(out[:3]) == pytest.approx(9.81, abs=0.07)  # four times the noise


@pytest.mark.parametrize(
    ("yaw", "compass"),
    [(-math.pi / 2, 0.0), (0.0, math.pi / 2), (math.pi / 2, math.pi), (math.pi, 1.5 * math.pi)],
)
def test_the_compass_counts_clockwise_from_north(yaw, compass):
    assert imu(yaw=yaw)[6] == pytest.approx(compass, abs=1e-6)


def test_accelerations_are_cut_where_carlas_sensor_cuts_them():
    assert imu(acceleration=-500.0)[0] == np.float32(-99.9)


def test_the_noise_is_the_leaderboards():
    readings = np.array([imu(tick=tick) for tick in range(4000)], np.float64)
    np.testing.assert_allclose(readings[:, :3].std(axis=0), [0.001, 0.001, 0.015], rtol=0.05)
    np.testing.assert_allclose(readings[:, 3:6].std(axis=0), [0.001] * 3, rtol=0.05)
    places = np.array([gnss(tick=tick) for tick in range(4000)])
    np.testing.assert_allclose(places.std(axis=0), [5e-6] * 3, rtol=0.05)
    noise = np.column_stack([readings[:, :6], places])
    assert np.abs(np.corrcoef(noise.T) - np.eye(9)).max() < 0.06  # each draw is its own


def test_the_noise_is_a_function_of_seed_and_tick():
    assert imu(tick=7).tobytes() == imu(tick=7).tobytes()
    assert imu(tick=7)[0] != imu(tick=8)[0]
    assert imu(tick=7)[0] != imu(tick=7, seed=2)[0]
    assert gnss(tick=7)[0] != gnss(tick=8)[0]


def test_one_degree_of_longitude_at_the_equator_lies_where_the_radius_says():
    east_m = math.radians(1.0) * EARTH_RADIUS_M
    assert geodetic(east_m, 0.0, 0.0, 0.0) == pytest.approx((0.0, 1.0), abs=1e-9)


def test_north_is_where_y_falls():
    latitude, _ = geodetic(0.0, -1000.0, 49.0, 8.0)
    assert latitude > 49.0


@given(floats(-5000, 5000), floats(-5000, 5000), floats(-60, 60), floats(-170, 170))
def test_mercator_run_backwards_gives_the_place_back(x, y, origin_latitude, origin_longitude):
    latitude, longitude = geodetic(x, y, origin_latitude, origin_longitude)
    scale = math.cos(math.radians(origin_latitude)) * EARTH_RADIUS_M

    def northing(degrees):
        return scale * math.asinh(math.tan(math.radians(degrees)))

    assert scale * math.radians(longitude - origin_longitude) == pytest.approx(x, abs=1e-4)
    assert northing(origin_latitude) - northing(latitude) == pytest.approx(y, abs=1e-4)
