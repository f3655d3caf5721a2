"""What stands between CARLA's sensors and an agent of ours there, each part by arithmetic."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest

from agents import AgentSpecError, load_agent
from agents.base import Requirements
from agents.carla.exported.lidar import thinned, whole_turn
from agents.carla.exported.pipe import read_message, write_message
from agents.carla.exported.place import Globe, Reckoning
from agents.carla.exported.sensors import REAR_M, sensors_of, ticks_a_decision, told_by
from agents.carla.exported.told import plan_of_route, shown_lights, town_of_text
from agents.carla.plan import global_plan
from di_envs.prompt import COMPONENTS
from di_envs.sensors.camera.config import rig_of
from di_envs.sensors.carla_suite import suite_of
from di_envs.sensors.lidar.config import LIDARS
from di_envs.suites import load_suite
from di_envs.town.lanes import LightState, SignalKind
from di_envs.town.loading import load_town

PAPER = LIDARS["paper"]
APART_DEG = 40.0 / 31.0  # between two of its channels


@pytest.fixture(scope="module")
def town():
    return load_town("toy")


@pytest.fixture(scope="module")
def plan(town):
    return load_suite("toy").plans(town, ["1"])[0]


def point_at(elevation_deg, azimuth_deg, far_m=20.0):
    elevation, azimuth = math.radians(elevation_deg), math.radians(azimuth_deg)
    level_m = far_m * math.cos(elevation)
    x, y = level_m * math.cos(azimuth), level_m * math.sin(azimuth)
    return [x, y, far_m * math.sin(elevation), 0.9]


def test_a_point_on_a_ray_of_ours_is_kept_in_its_row_and_told_in_the_egos_frame():
    """Channel 2 of 32 is 2.58 degrees below the topmost; step 7 of 175 is 14.4 to the right."""
    elevation_deg, azimuth_deg = 10.0 - 2.0 * APART_DEG, 7.0 * 360.0 / 175.0
    point = np.array([point_at(elevation_deg, azimuth_deg)], np.float32)
    found = thinned(point, PAPER)
    assert found.shape == (PAPER.rays, 4)
    assert found[:, 3].nonzero()[0].tolist() == [7 * 32 + 2]
    assert found[7 * 32 + 2] == pytest.approx(point[0] + [1.3, 0.0, 2.5, 0.0])


@pytest.mark.parametrize(
    ("elevation_deg", "azimuth_deg"), [(10.0 - 0.5 * APART_DEG, 0.0), (10.0, 0.5 * 360.0 / 175.0)]
)
def test_a_point_between_two_rays_of_ours_is_not(elevation_deg, azimuth_deg):
    point = np.array([point_at(elevation_deg, azimuth_deg)], np.float32)
    assert not thinned(point, PAPER).any()


def test_the_half_of_the_tick_before_stays_where_it_was_in_the_world():
    """The ego went 2 m on and turned left: what was 10 m ahead is 8 m ahead, then to its right."""
    before, half = np.zeros((3, 4), np.float32), np.zeros((3, 4), np.float32)
    before[0], before[1], half[1] = (
        [10.0, 0.0, 1.0, 0.5],
        [5.0, 5.0, 0.0, 0.5],
        [1.0, 2.0, 3.0, 0.7],
    )
    whole = whole_turn(half, before, (3.0, 4.0, 0.0), (5.0, 4.0, -0.5 * math.pi))
    assert whole[0] == pytest.approx([0.0, 8.0, 1.0, 0.5], abs=1e-5)
    assert whole[1] == pytest.approx([1.0, 2.0, 3.0, 0.7])
    assert not whole[2].any()


@pytest.mark.parametrize("origin", [(0.0, 0.0), (49.0, 8.0)])
def test_a_route_that_is_told_in_degrees_and_metres_says_where_any_degrees_are(plan, origin):
    gps, world = global_plan(plan, origin)
    degrees = np.array([[point["lat"], point["lon"]] for point, _ in gps])
    metres = np.array([[place.location.x, place.location.y] for place, _ in world])
    globe = Globe.of_route(degrees[::7], metres[::7])
    found = np.array([globe.metres(*point) for point in degrees.tolist()])
    assert np.abs(found - plan.points[:, :2]).max() < 0.001


def imu_of(compass, rate=0.0):
    return np.array([0.0, 0.0, 9.81, 0.0, 0.0, rate, compass])


def test_a_place_is_reckoned_by_speed_and_compass_and_noise_of_gnss_hardly_moves_it():
    """East at 10 m/s for 10 s, with readings that are 0.56 m off in each axis."""
    noise = np.random.default_rng(0).normal(0.0, 0.56, (200, 2))
    here = Reckoning.at(100.0, 50.0, 0.0)
    here = here.after((100.0 - REAR_M, 50.0), imu_of(0.5 * math.pi), 10.0)
    off_m = []
    for tick in range(1, 200):
        east, south = 100.25 + 0.5 * tick - REAR_M + noise[tick, 0], 50.0 + noise[tick, 1]
        here = here.after((east, south), imu_of(0.5 * math.pi), 10.0)
        x, y, _ = here.pose
        off_m.append(math.hypot(x - (100.25 + 0.5 * tick), y - 50.0))
    assert max(off_m) < 0.15


def test_a_wrong_place_is_mended_by_gnss_in_seconds():
    here = Reckoning.at(2.0, 0.0, 0.0)
    for _ in range(300):
        here = here.after((-REAR_M, 0.0), imu_of(0.5 * math.pi), 0.0)
    assert here.pose[0] == pytest.approx(0.0, abs=0.3)


def test_a_compass_that_says_nothing_is_replaced_by_the_rate_of_turn():
    here = Reckoning.at(0.0, 0.0, 0.3).after((0.0, 0.0), imu_of(math.nan, rate=0.2), 5.0)
    assert here.yaw == pytest.approx(0.31)


def test_lights_are_told_to_the_nearest_boxes_and_never_to_signs(town):
    boxes, kinds = town.signals.box, town.signals.kind
    lit = (kinds == SignalKind.LIGHT).nonzero()[0]
    lights = np.column_stack([boxes[lit, :2] + 0.4, np.full(len(lit), LightState.RED)])
    lights[0, 2] = LightState.GREEN
    shown = shown_lights(town, lights)
    assert shown[lit[0]] == LightState.GREEN
    assert (shown[lit[1:]] == LightState.RED).all()
    assert (shown[kinds != SignalKind.LIGHT] == LightState.NONE).all()
    far = lights + np.array([500.0, 0.0, 0.0])
    assert (shown_lights(town, far) == LightState.NONE).all()


def test_a_route_and_a_map_that_are_handed_over_are_ours(town, plan):
    again = plan_of_route(plan.points, plan.option.astype(np.int64))
    assert again.targets.tolist() == plan.targets.tolist()
    assert again.route_m == pytest.approx(plan.route_m)
    same = town_of_text("Carla/Maps/Toy", town.opendrive)
    assert same.content_hash == town.content_hash


def test_carlas_sensors_are_our_own_again():
    options = {"cameras": "driveinsight", "lidar": "paper"}
    requires = Requirements(observations=("camera", "lidar", "prompt"), options=options)
    suite = suite_of(sensors_of("mine", requires), limits="none")
    assert [sensor.type for sensor in suite.sensors][:3] == [
        "sensor.other.gnss", "sensor.other.imu", "sensor.speedometer"
    ]  # fmt: skip
    shown = [camera for sensor in suite.sensors for camera in sensor.cameras]
    for ours, theirs in zip(rig_of("driveinsight").cameras, shown, strict=True):
        assert theirs.name == f"camera_{ours.name}"
        assert theirs.ego_from_camera() == pytest.approx(ours.ego_from_camera(), abs=1e-15)
        assert theirs.intrinsics().tolist() == ours.intrinsics().tolist()
    lidar = suite.options["lidar"]
    assert (lidar.x_m, lidar.y_m, lidar.z_m) == (PAPER.x_m, PAPER.y_m, PAPER.z_m)


@pytest.mark.parametrize(
    ("requires", "says"),
    [
        (Requirements(privileged=True), "reads the world's state"),
        (Requirements(hd_map=True), "reads the world's state or our map"),
        (Requirements(observations=("radar",)), "needs the group 'radar'"),
        (Requirements(observations=("lidar",), options={"lidar": "dense"}), "1800 steps"),
    ],
)
def test_who_needs_what_carla_has_not_is_refused(requires, says):
    with pytest.raises(AgentSpecError, match=says):
        sensors_of("mine", requires)


def test_a_decision_takes_whole_ticks():
    assert ticks_a_decision("mine", Requirements(control_dt_s=0.1)) == 2
    with pytest.raises(AgentSpecError, match="a multiple"):
        ticks_a_decision("mine", Requirements(control_dt_s=0.07))


def test_who_does_not_say_what_it_reads_of_the_prompt_reads_all_of_it():
    assert told_by(load_agent("constant")) == COMPONENTS


def test_messages_carry_values_and_arrays_and_no_halves_of_them():
    array = np.arange(6, dtype=np.int16).reshape(2, 3)
    head = b'{"ask": "tick", "arrays": [["mine", "<i2", [2, 3]]]}\n'
    values, arrays = read_message(io.BytesIO(head + array.tobytes()))
    assert values == {"ask": "tick"}
    assert arrays["mine"].tolist() == array.tolist()
    assert read_message(io.BytesIO(b"")) is None
    with pytest.raises(EOFError, match="before its arrays do"):
        read_message(io.BytesIO(head + b"1234"))
    sent = io.BytesIO()
    write_message(sent, {"control": [0.5, 0.0, 0.0]})
    assert sent.getvalue() == b'{"control": [0.5, 0.0, 0.0]}\n'
