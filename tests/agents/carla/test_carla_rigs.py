"""Rigs of published agents: cameras from above, radars, tags, depths, events, by arithmetic."""

from __future__ import annotations

import math

import numpy as np
import pytest

from agents.carla.events import EventMemory, events_of
from agents.carla.formats import SEMANTIC_POINT, radar_points, with_origin
from agents.carla.images import depth_image, instance_image, semantic_image
from agents.carla.tags import tags_of_version
from di_envs.sensors.carla_sensor import CarlaSensor, SensorSuiteError
from di_envs.sensors.carla_suite import suite_of
from di_envs.sensors.carla_types import SensorType
from di_envs.sensors.scene.tags import Tag
from tests.agents.carla.scenes import Scene

LEVEL = {"roll": 0.0, "pitch": 0.0, "yaw": 0.0}
AT_ROOF = {"x": 0.0, "y": 0.0, "z": 1.5, **LEVEL}
BEV = {"x": 0.0, "y": 0.0, "z": 50.0, **LEVEL, "pitch": -90.0, "width": 100, "height": 100}
SMALL = {"width": 61, "height": 31, "fov": 60}
SUITE = suite_of(
    [
        {"type": "sensor.camera.semantic_segmentation", "id": "bev", **BEV, "fov": 53.13},
        {"type": "sensor.camera.depth", "id": "depth", **AT_ROOF, **SMALL},
        {"type": "sensor.camera.instance_segmentation", "id": "instance", **AT_ROOF, **SMALL},
        {"type": "sensor.stitch_camera.rgb", "id": "wide", **AT_ROOF, **SMALL},
        {"type": "sensor.lidar.ray_cast_semantic", "id": "lidar", **AT_ROOF},
        {"type": "sensor.other.radar", "id": "radar", **AT_ROOF, "x": 2.0, "z": 0.8, "fov": 10},
        {"type": "sensor.other.collision", "id": "bump"},
        {"type": "sensor.collision", "id": "bumped"},
        {"type": "sensor.other.lane_invasion", "id": "line"},
        {"type": "sensor.other.obstacle", "id": "ahead", "distance": 20},
    ],
    leaderboard="2.1",
)
HALF_M = 2.3  # of the car, in whichever way it stands


@pytest.fixture(scope="module")
def seen():
    """A car 16 m ahead and 8 m to the right is seen from above; one ahead by all others."""
    scene = Scene()
    fields = {"half_length": HALF_M, "half_width": 1.0, "speed": 5.0}
    above = scene.seen(SUITE, 16.0, 8.0, **fields)[1]
    return above, scene.seen(SUITE, 12.0, 0.0, **fields)[1]


def test_a_camera_straight_above_has_ahead_on_top_and_right_on_the_right(seen):
    """From 50 m with 53.13 degrees it shows 50 m in 100 pixels: 16 m ahead is 32 rows up."""
    tags = seen[0]["bev"][1][..., 2]
    rows, columns = np.nonzero(tags == Tag.CAR)
    assert len(rows) > 20
    assert rows.mean() == pytest.approx(50.0 - 32.0, abs=1.5)
    assert columns.mean() == pytest.approx(50.0 + 16.0, abs=1.5)


def test_depth_is_coded_in_three_bytes_and_read_back_by_carlas_formula(seen):
    blue, green, red = (seen[1]["depth"][1][..., k].astype(np.float64) for k in range(3))
    metres = (red + 256.0 * green + 65536.0 * blue) / (2**24 - 1) * 1000.0
    back_m = 12.0 - HALF_M
    assert metres[18, 30] == pytest.approx(back_m, abs=0.6)
    assert depth_image(np.float32([[1000.0]])).tolist() == [[[255, 255, 255, 255]]]
    assert depth_image(np.float32([[0.0]])).tolist() == [[[0, 0, 0, 255]]]


def test_instances_have_the_tag_in_red_and_the_id_in_green_and_blue(seen):
    pixel = seen[1]["instance"][1][18, 30]
    assert pixel[2] == Tag.CAR
    assert int(pixel[1]) + 256 * int(pixel[0]) == 2  # actor 1
    image = instance_image(np.uint8([[14]]), np.int32([[0x1234]]))
    assert image.tolist() == [[[0x12, 0x34, 14, 255]]]
    assert semantic_image(np.uint8([[7]])).tolist() == [[[0, 0, 7, 255]]]


def test_a_stitched_camera_is_three_images_side_by_side(seen):
    assert seen[1]["wide"][1].shape == (31, 3 * 61, 3)
    left, middle, right = SUITE.sensors[3].cameras
    assert math.degrees(left.yaw_rad) == pytest.approx(-55.0)  # 60 less 5 of overlap
    assert (middle.yaw_rad, math.degrees(right.yaw_rad)) == (0.0, pytest.approx(55.0))


def test_a_semantic_lidar_tells_place_angle_actor_and_tag_and_loses_no_rays(seen):
    points = seen[1]["lidar"][1]
    assert points.dtype == SEMANTIC_POINT
    car = points[points["ObjTag"] == Tag.CAR]
    assert len(car) > 50
    assert set(car["ObjIdx"].tolist()) == {2}
    back = car[(car["x"] < 12.0 - HALF_M + 0.3) & (np.abs(car["z"] + 0.8) < 0.2)]
    assert len(back) > 5
    assert np.median(back["CosAngle"]) > 0.95  # it is square to the rays
    ground = points[(points["ObjIdx"] == 0) & (np.abs(points["z"] + 1.5) < 0.01)]
    far = np.sqrt(ground["x"] ** 2 + ground["y"] ** 2 + ground["z"] ** 2)
    np.testing.assert_allclose(ground["CosAngle"], 1.5 / far, atol=1e-3)


def test_a_radar_tells_distance_elevation_azimuth_and_speed_away(seen):
    """From 2 m ahead of the middle to the back of a car at 12 m; it drives 5, the ego 3 m/s."""
    rows = seen[1]["radar"][1]
    assert rows.dtype == np.float32
    assert 10 < len(rows) <= 75  # 1500 a second
    car = rows[rows[:, 3] > 0.0]
    assert car[:, 0].min() == pytest.approx(12.0 - HALF_M - 2.0, abs=0.3)
    np.testing.assert_allclose(car[:, 3], 2.0, atol=0.03)
    ground = rows[rows[:, 3] < 0.0]
    np.testing.assert_allclose(ground[:, 0] * np.sin(-ground[:, 1]), 0.8, atol=0.02)
    np.testing.assert_allclose(
        ground[:, 3], -3.0 * np.cos(ground[:, 1]) * np.cos(ground[:, 2]), atol=0.05
    )
    assert np.abs(rows[:, 1:3]).max() <= math.radians(5.0) + 1e-6
    given = np.float32([[10.0, 0.1, -0.2, 3.0], [0.0, 0.0, 0.0, 0.0]])
    assert radar_points(given).tolist() == np.float32([[10.0, -0.2, 0.1, 3.0]]).tolist()


def test_an_obstacle_is_told_within_its_distance(seen):
    (event,) = seen[1]["ahead"][1]
    assert event.distance == pytest.approx(12.0 - HALF_M, abs=0.01)
    assert (event.other_actor.id, event.other_actor.type_id) == (2, "vehicle.car")
    near = CarlaSensor(id="near", type=SensorType.OBSTACLE)  # 5 m, as in CARLA
    observation = touched(obstacle=[2.0, 1.0, 9.7])
    assert events_of(near, observation, EventMemory(), 1) == []


def touched(contacts=(), obstacle=(0.0, 0.0, 0.0), across=0):
    rows = np.zeros((8, 4), np.float32)
    for row, contact in enumerate(contacts):
        rows[row] = contact
    obstacle, across = np.float32(obstacle), np.uint8([across])
    return {"contacts": rows, "obstacle": obstacle, "across_line": across}


def test_collisions_are_events_while_they_last_and_are_remembered_by_world_on_rails_sensor():
    bump = CarlaSensor(id="bump", type=SensorType.COLLISION)
    ever = CarlaSensor(id="ever", type=SensorType.COLLIDED)
    free, memory = touched(), EventMemory()
    assert events_of(bump, free, memory, 1) == []
    assert events_of(ever, free, memory, 1) is False
    hit = touched(contacts=[[5.0, 7.0, 3.0, 4.0]])
    (event,) = events_of(bump, hit, memory, 2)
    assert (event.other_actor.type_id, event.frame) == ("walker.pedestrian", 2)
    assert (event.normal_impulse.x, event.normal_impulse.y) == (-0.6, -0.8)
    assert events_of(ever, hit, memory, 2) is True
    memory = memory.after(hit)
    assert events_of(ever, free, memory, 3) is True


def test_a_lane_invasion_is_told_once_when_the_car_comes_over_a_line():
    line, memory = CarlaSensor(id="line", type=SensorType.LANE_INVASION), EventMemory()
    told = []
    for across in (0, 1, 1, 0, 1):
        observation = touched(across=across)
        told.append(len(events_of(line, observation, memory, 1)))
        memory = memory.after(observation)
    assert told == [0, 1, 0, 0, 1]


def test_sensors_of_events_say_what_the_environment_lacks():
    with pytest.raises(SensorSuiteError, match="made without group 'proximity'"):
        events_of(CarlaSensor(id="a", type=SensorType.COLLISION), {}, EventMemory(), 1)


def test_tags_are_those_of_the_carla_that_the_leaderboard_runs():
    tags = np.uint8([Tag.ROADS, Tag.CAR, Tag.BUS, Tag.PEDESTRIANS, Tag.ROAD_LINES])
    assert tags_of_version(tags, "1.0").tolist() == [7, 10, 10, 4, 6]
    assert tags_of_version(tags, "2.1").tolist() == [1, 14, 16, 12, 24]


def test_the_maps_text_has_the_origin_by_which_gnss_counts():
    text = "<a><geoReference><![CDATA[+proj=tmerc +lat_0=49 +lon_0=8 +k=1]]></geoReference></a>"
    moved = with_origin(text, (0.0, -1.5))
    assert "+lat_0=0.0 +lon_0=-1.5 +k=1" in moved
    assert with_origin(text, (49.0, 8.0)) == text
    assert with_origin("<a/>", (0.0, 0.0)) == "<a/>"
