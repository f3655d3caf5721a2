"""What a Leaderboard agent is handed: formats, axes and orders, by arithmetic and in a scene."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats

from agents.carla.formats import gnss_at, imu_turned, input_data, lidar_points
from agents.carla.images import bgra
from agents.carla.plan import moved
from di_envs.sensors.carla_sensor import CarlaSensor, SensorSuiteError
from di_envs.sensors.carla_suite import suite_of
from di_envs.sensors.carla_types import SensorType
from di_envs.sensors.inertial import EARTH_RADIUS_M, geodetic
from tests.agents.carla.scenes import Scene

LEVEL = {"roll": 0.0, "pitch": 0.0, "yaw": 0.0}
AT_ROOF = {"x": 0.0, "y": 0.0, "z": 1.5, **LEVEL}
CAMERA = {"type": "sensor.camera.rgb", "id": "rgb", **AT_ROOF, "width": 201, "height": 101}
SUITE = suite_of(
    [
        {**CAMERA, "fov": 60.0},
        {"type": "sensor.lidar.ray_cast", "id": "lidar", **AT_ROOF},
        {"type": "sensor.other.gnss", "id": "gps", "x": -1.4, "y": 0.0, "z": 0.5},
        {"type": "sensor.other.imu", "id": "imu", **AT_ROOF},
        {"type": "sensor.speedometer", "id": "speed"},
        {"type": "sensor.opendrive_map", "id": "map", "reading_frequency": 1},
    ],
    "MAP",
)


def lidar_at(**mounting):
    return CarlaSensor(id="lidar", type=SensorType.LIDAR, **mounting)


@pytest.fixture(scope="module")
def scene():
    return Scene()


def seen(scene, x, y, **fields):
    return scene.seen(SUITE, x, y, **fields)


def test_every_sensor_has_its_shape_and_type(scene):
    _, data = seen(scene, 10.0, 0.0)
    assert {frame for frame, _ in data.values()} == {7}
    assert list(data) == ["rgb", "lidar", "gps", "imu", "speed", "map"]
    values = {name: value for name, (_, value) in data.items()}
    assert (values["rgb"].shape, values["rgb"].dtype) == ((101, 201, 4), np.uint8)
    assert values["lidar"].shape[1] == 4
    assert values["lidar"].dtype == np.float32
    assert (values["gps"].shape, values["gps"].dtype) == ((3,), np.float64)
    assert (values["imu"].shape, values["imu"].dtype) == ((7,), np.float64)
    assert values["speed"] == {"speed": 3.0, "spd": 3.0}
    assert values["map"] == {"opendrive": scene.town.opendrive}


def test_a_red_box_ahead_is_red_in_channel_two(scene):
    """Brake lights of a car ahead that looks away: red, so channel 2 of blue, green, red, alpha."""
    observation, data = seen(scene, 8.0, 0.0, brake_light=1)
    image = data["rgb"][1]
    assert (image[..., 3] == 255).all()
    np.testing.assert_array_equal(image[..., 2::-1], observation["camera_rgb"])
    below = image[51:].astype(int)
    lit = (below[..., 2] > 150) & (below[..., 0] < 90) & (below[..., 1] < 90)
    assert lit.sum() > 20
    assert abs(np.nonzero(lit)[1].mean() - 100.0) < 3.0  # one on either side of the middle
    _, dark = seen(scene, 8.0, 0.0, brake_light=0)
    assert dark["rgb"][1][51:][lit].astype(int)[:, 2].mean() < below[lit][:, 2].mean() - 40.0


def test_blue_comes_first():
    image = bgra(np.array([[[250, 20, 3]]], np.uint8))
    assert image.tolist() == [[[3, 20, 250, 255]]]


def test_a_box_on_the_right_has_positive_y_in_the_lidar(scene):
    _, data = seen(scene, 0.0, 10.0)
    points = data["lidar"][1]
    solid = points[points[:, 2] > -1.2]  # above the ground, which is 1.5 m below the sensor
    assert len(solid) > 50
    assert (solid[:, 1] > 8.0).all()
    assert np.abs(solid[:, 0]).max() < 3.0


def test_a_box_ahead_has_positive_x_and_its_height_is_up(scene):
    _, data = seen(scene, 12.0, 0.0)
    points = data["lidar"][1]
    solid = points[points[:, 2] > -1.2]
    assert (solid[:, 0] > 9.0).all()
    assert -1.5 < solid[:, 2].min() < solid[:, 2].max() < 1.0
    behind = points[points[:, 0] < 0.0]
    np.testing.assert_allclose(behind[:, 2], -1.5, atol=0.02)


def test_rays_that_did_not_come_back_are_not_there():
    points = np.array([[1, 2, 3, 0.5], [0, 0, 0, 0], [4, 5, 6, 0.9]], np.float32)
    assert lidar_points(points, lidar_at()).tolist() == points[[0, 2]].tolist()


@pytest.mark.parametrize(
    ("yaw_deg", "ahead", "right"), [(0.0, 5.0, -2.0), (90.0, -2.0, -5.0), (-90.0, 2.0, 5.0)]
)
def test_points_are_told_along_the_axes_of_a_turned_lidar(yaw_deg, ahead, right):
    """5 m ahead and 2 m to the left of the sensor: a sensor that looks left has it 2 m ahead."""
    sensor = lidar_at(x_m=1.3, y_m=0.5, z_m=2.5, yaw_rad=math.radians(yaw_deg))
    points = np.array([[6.3, -1.5, 0.0, 0.7]], np.float32)
    found = lidar_points(points, sensor)
    np.testing.assert_allclose(found, [[ahead, right, -2.5, 0.7]], atol=1e-5)


def test_the_compass_counts_clockwise_from_north_and_east_is_a_quarter(scene):
    _, data = seen(scene, 10.0, 0.0)
    assert data["imu"][1][6] == pytest.approx(math.pi / 2.0, abs=1e-6)  # the ego faces east
    assert data["imu"][1][2] == pytest.approx(9.81, abs=0.1)


def test_a_turned_imu_tells_along_its_own_axes():
    imu = np.array([2.0, 0.5, 9.81, 0.0, 0.0, 0.3, 1.0], np.float32)
    right = imu_turned(imu, math.pi / 2.0)  # ahead is now to its left
    np.testing.assert_allclose(right, [0.5, -2.0, 9.81, 0.0, 0.0, 0.3, 1.0 + math.pi / 2.0], 1e-6)
    assert imu_turned(imu, 2.0 * math.pi)[6] == pytest.approx(1.0)


@given(*(floats(-500.0, 500.0) for _ in range(4)), floats(-60.0, 60.0))
def test_a_place_that_is_moved_is_where_mercator_puts_it(x, y, east, south, origin):
    latitude, longitude = geodetic(x, y, origin, 8.0)
    found = moved(latitude, longitude, east, south, origin)
    np.testing.assert_allclose(found, geodetic(x + east, y + south, origin, 8.0), atol=2e-9, rtol=0)


@pytest.mark.parametrize(
    ("yaw", "east_m", "north_m"), [(0.0, -1.4, 0.0), (math.pi / 2.0, 0.0, 1.4)]
)
def test_gnss_is_read_where_it_is_mounted(yaw, east_m, north_m):
    """1.4 m behind the middle: to the west of a car that faces east, north of one facing south."""
    sensor = CarlaSensor(id="gps", type=SensorType.GNSS, x_m=-1.4, z_m=0.5)
    imu = np.zeros(7, np.float32)
    imu[6] = yaw + math.pi / 2.0
    latitude, longitude, altitude = gnss_at(np.array([0.0, 8.0, 3.0]), imu, sensor, 0.0)
    degree_m = math.radians(1.0) * EARTH_RADIUS_M
    assert latitude * degree_m == pytest.approx(north_m, abs=1e-3)
    assert (longitude - 8.0) * degree_m == pytest.approx(east_m, abs=1e-3)
    assert altitude == 3.5


def test_an_environment_made_for_other_sensors_is_refused():
    with pytest.raises(SensorSuiteError, match=r"'rgb'.*made without 'camera_rgb'"):
        input_data(SUITE, {}, 1, (0.0, 0.0))
