"""Suites of Leaderboard agents: what is asked for, what is refused, and with which words."""

from __future__ import annotations

import math

import pytest

from di_envs.config import RouteEnvConfig
from di_envs.sensors.carla_sensor import SensorSuiteError
from di_envs.sensors.carla_suite import suite_of
from di_envs.sensors.lidar.config import LIDARS

LEVEL = {"roll": 0.0, "pitch": 0.0, "yaw": 0.0}
PLACE = {"x": 0.7, "y": -0.4, "z": 1.6}


def camera(id_="front", **changes):
    size = {"width": 300, "height": 200, "fov": 100}
    return {"type": "sensor.camera.rgb", "id": id_, **PLACE, **LEVEL, **size, **changes}


def lidar(id_="lidar", **changes):
    return {"type": "sensor.lidar.ray_cast", "id": id_, **PLACE, **LEVEL, **changes}


def gnss(id_="gps", **changes):
    return {"type": "sensor.other.gnss", "id": id_, "x": -1.4, "y": 0.0, "z": 0.0, **changes}


def imu(id_="imu", **changes):
    return {"type": "sensor.other.imu", "id": id_, **PLACE, **LEVEL, **changes}


def radar(id_="radar", **changes):
    return {"type": "sensor.other.radar", "id": id_, **PLACE, **LEVEL, "fov": 30, **changes}


def strict(sensors, track="SENSORS", leaderboard="1.0"):
    return suite_of(sensors, track, leaderboard, "leaderboard")


SPEEDOMETER = {"type": "sensor.speedometer", "id": "speed", "reading_frequency": 20}
MAP = {"type": "sensor.opendrive_map", "id": "map", "reading_frequency": 1}


def test_the_documents_suite_becomes_a_rig_a_lidar_and_groups():
    suite = suite_of([camera("Left", yaw=-60.0), camera("Right", yaw=60.0), lidar(yaw=-90.0)])
    left, right = suite.options["cameras"].cameras
    assert (left.name, left.width, left.height, left.fov_deg) == ("camera_Left", 300, 200, 100.0)
    assert (left.x_m, left.y_m, left.z_m) == (0.7, -0.4, 1.6)
    assert left.yaw_rad == pytest.approx(-math.pi / 3)
    assert right.yaw_rad == pytest.approx(math.pi / 3)
    assert suite.observations == ("camera", "lidar")
    config = suite.options["lidar"]
    assert (config.channels, config.steps, config.range_m) == (64, 937, 85.0)
    assert config.channels * config.steps * 10 == pytest.approx(600_000, rel=1e-3)  # points a s
    assert (config.upper_deg, config.lower_deg) == (10.0, -30.0)
    assert (config.dropoff, config.dropoff_intensity, config.dropoff_zero) == (0.45, 0.8, 0.4)
    assert (config.x_m, config.z_m) == (0.7, 1.6)
    assert suite.sensors[2].yaw_rad == pytest.approx(-math.pi / 2)


def test_what_a_suite_asks_for_an_environment_can_be_made_with():
    suite = suite_of([camera(), lidar(), gnss(), imu(), SPEEDOMETER])
    config = RouteEnvConfig(suite="toy", observations=suite.observations, **suite.options)
    assert config.observations == ("camera", "lidar", "inertial")


def test_without_cameras_or_lidar_the_shipped_ones_are_not_asked_for():
    suite = suite_of([gnss(), imu()])
    assert suite.observations == ("inertial",)
    assert suite.options == {}
    assert suite_of([]).observations == ("inertial",)  # an environment shows something


def test_the_leaderboards_lidar_is_the_shipped_one():
    sensor = suite_of([lidar(x=1.3, y=0.0, z=2.5)])
    assert sensor.options["lidar"] == LIDARS["leaderboard"]


def test_keys_that_carla_does_not_read_are_ignored_here_too():
    assert suite_of([camera(sensor_tick=0.05), SPEEDOMETER]).sensors[0].id == "front"


def test_each_leaderboard_and_track_has_its_limits():
    eight = [camera(f"c{k}") for k in range(8)]
    assert len(strict(eight, "SENSORS", "2.1").sensors) == 8
    assert len(strict(eight[:4]).sensors) == 4
    for track, leaderboard in (("SENSORS", "1.0"), ("SENSORS_QUALIFIER", "2.0")):
        with pytest.raises(SensorSuiteError, match=r"Too many .*camera.*: 5.* allows 4"):
            strict(eight[:5], track, leaderboard)
    with pytest.raises(SensorSuiteError, match="allows 8"):
        strict([*eight, camera("c8")], "SENSORS", "2.0")
    with pytest.raises(SensorSuiteError, match=r"gnss: 2; .* allows 1"):
        strict([gnss("a"), gnss("b")])
    with pytest.raises(SensorSuiteError, match=r"3\.46 m .* the Leaderboard allows 3 m"):
        strict([camera(x=2.0, y=2.0, z=2.0)])
    with pytest.raises(SensorSuiteError, match=r"other\.collision: 1; .* allows 0"):
        strict([{"type": "sensor.other.collision", "id": "bump"}])


def test_without_the_leaderboards_limits_a_suite_may_have_more_and_reach_further():
    assert len(suite_of([camera(f"c{k}") for k in range(9)]).sensors) == 9
    above = suite_of([camera("bev", x=0.0, y=0.0, z=50.0, pitch=-90.0), camera("b2", pitch=270)])
    assert [math.degrees(c.pitch_rad) for c in above.options["cameras"].cameras] == [-90.0, -90.0]
    radars = suite_of([radar("a"), radar("b", yaw=180.0)])
    assert radars.observations == ("radar",)
    assert [config.name for config in radars.options["radars"]] == ["radar_a", "radar_b"]
    assert radars.options["radars"][0].rays == 75  # 1500 a second at 20 Hz
    events = suite_of([{"type": "sensor.other.collision", "id": "bump"}])
    assert (events.observations, events.options) == (("proximity",), {})


def test_the_map_is_for_the_track_of_that_name():
    assert suite_of([MAP], "SENSORS").with_map
    assert strict([MAP], "MAP").with_map
    with pytest.raises(SensorSuiteError, match=r"track MAP; this one's is SENSORS.*setup"):
        strict([MAP], "SENSORS")


@pytest.mark.parametrize(
    ("sensors", "says"),
    [
        ([camera(roll=10.0)], r"'front' \(roll of a sensor\.camera\.rgb is not simulated\)"),
        ([lidar(pitch=-5.0)], r"'lidar' \(pitch"),
        ([lidar(z=50.0)], r"'lidar' \(.*more than 20 m away"),
        ([imu(roll=1.0)], r"'imu' \(roll"),
        ([lidar(), lidar("second")], r"'second' \(this world carries 1 LiDAR\)"),
        ([{"type": "sensor.camera.dvs", "id": "dvs"}], r"'dvs' \(sensor\.camera\.dvs is not"),
        ([camera(roll=10.0), imu(roll=1.0)], r"'front' .*, 'imu' .*\.$"),
    ],
)
def test_what_is_not_simulated_gives_empty_data_with_one_warning(sensors, says):
    with pytest.warns(UserWarning, match=f"give empty data: {says}") as met:
        suite = suite_of(sensors)
    assert len(met) == 1
    assert any(sensor.empty for sensor in suite.sensors)


@pytest.mark.parametrize(
    ("sensors", "says"),
    [
        ([camera(), camera()], "'front' is given 2 times"),
        ([camera(z=1000.5)], "1000.50 m from the ego's origin; at most 1000 m"),
        ([{**camera(), "type": "sensor.camera.rbg"}], r"did you mean 'sensor\.camera\.rgb'"),
        ([{**camera(), "type": ["sensor.camera.rgb"]}], "unknown type"),
        ([{"type": "sensor.camera.rgb"}], "needs an 'id'"),
        ([{**camera(), "id": 3}], "needs an 'id', a string; got 3"),
        (["sensor.camera.rgb"], "must be a dict"),
        (None, "must return a list of dicts; got None"),
        ({"type": "sensor.camera.rgb"}, "must return a list"),
        ([{k: v for k, v in camera().items() if k != "fov"}], r"'front' .* lacks 'fov'"),
        ([camera(fov=180)], "'front'.*field of view between 0 and 180"),
        ([camera(width=0)], "'front'.*1 to 8192 pixels"),
        ([camera(width=300.5)], "'front'.*width is a number of pixels; got 300.5"),
        ([camera(x=math.nan)], "x must be a number; got nan"),
        ([camera(yaw="east")], "yaw must be a number; got 'east'"),
        ([radar(fov=180.0)], "'radar'.*cone of 0 to 180 degrees"),
        ([{**radar(), "fov": "wide"}], "fov must be a number"),
    ],
)
def test_what_is_wrong_is_said_with_the_sensors_id(sensors, says):
    with pytest.raises(SensorSuiteError, match=says):
        suite_of(sensors)


def test_unknown_tracks_and_leaderboards_list_the_known():
    with pytest.raises(SensorSuiteError, match=r"'SENSOR'.*SENSORS, MAP\."):
        suite_of([], "SENSOR")
    with pytest.raises(SensorSuiteError, match="MAP_QUALIFIER"):
        suite_of([], "SENSOR", "2.1")
    with pytest.raises(SensorSuiteError, match=r"known: 1\.0, 2\.0, 2\.1"):
        suite_of([], "SENSORS", "3.0")


def test_full_turns_are_no_roll():
    assert suite_of([camera(roll=360.0), imu(pitch=-360.0)]).sensors
