"""Cameras: arithmetic of projection, the same bits again, weathers, lamps that can be read."""

from __future__ import annotations

import hashlib
import math
import subprocess
import sys
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest

import di_envs
from di_envs.sensors.camera.cameras import FAR_M, CameraRig
from di_envs.sensors.camera.config import RIGS, CameraConfig, Rig, rig_of
from di_envs.sensors.scene.scene import scene_of
from di_envs.sensors.scene.tags import Tag
from di_envs.sensors.weather import PRESETS, weather_of
from di_envs.town.lanes import LaneKind, LightState, SignalKind
from di_envs.town.loading import load_town
from di_envs.world.state import ActorKind, views_of
from di_envs.world.world import World, WorldConfig


@pytest.fixture(scope="module")
def town():
    return load_town("town05")


@pytest.fixture
def empty(town):
    """A town with an ego and one more vehicle, both where a test puts them."""
    world = World(town, WorldConfig(vehicles=2, walkers=0))
    world.reset(0, [])
    place(world, 1, 500.0, 500.0)
    return world


def place(world, actor, x, y, z=0.0, yaw=0.0, **fields):
    snapshot = world.save()
    state = views_of(snapshot.record)
    for name, value in {"x": x, "y": y, "z": z, "yaw": yaw, **fields}.items():
        getattr(state, name)[actor] = value
    world.restore(snapshot)


def images(world, rig, weather="ClearNoon", ego=0):
    cameras = CameraRig(world.town, rig_of(rig), weather_of(weather), ego)
    cameras.start(world.view)
    return cameras.observe()


def full(width=320, height=200, fov_deg=90.0, **mount):
    camera = CameraConfig(name="camera_front", width=width, height=height, fov_deg=fov_deg, **mount)
    return Rig(cameras=(camera,), depth=True, semantic=True, instance=True)


def before_stop_line(town, metres, number=0):
    """A pose on the lane, with the ego's camera so far before a light's stop line."""
    signals = town.signals
    stops = np.flatnonzero(signals.kind[signals.stop_signal] == 1)
    x, y, z, yaw = signals.stop_pose[stops[number]]
    return x - metres * math.cos(yaw), y - metres * math.sin(yaw), z, yaw


def test_a_box_10_m_ahead_has_the_height_in_pixels_that_arithmetic_gives(empty):
    """A post 3 m high and 1.32 m wide, its face 10 m ahead of a camera 1.5 m above the ground."""
    place(empty, 0, 600.0, 600.0)
    size = {"half_length": 1.0, "half_width": 1.2, "height": 3.0}  # a post fills 0.55 of its box
    place(empty, 1, 610.0 + 0.55, 600.0, kind=ActorKind.PROP, **size)
    seen = images(empty, full(fov_deg=90.0, x_m=0.0, z_m=1.5))
    focal = 160.0  # half of 320 pixels, over tan 45 degrees
    mask = seen["camera_front_instance"] == 2
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    assert rows[-1] + 1 - rows[0] == pytest.approx(3.0 * focal / 10.0, abs=1.0)
    assert columns[-1] + 1 - columns[0] == pytest.approx(1.32 * focal / 10.0, abs=1.0)
    assert (rows[0] + rows[-1] + 1) / 2 == pytest.approx(100.0, abs=0.5)
    assert seen["camera_front_depth"][100, 160] == pytest.approx(10.0, abs=1e-3)
    assert seen["camera_front_semantic"][100, 160] == Tag.POLES


def test_the_depth_of_the_ground_is_height_over_slope(empty):
    place(empty, 0, 600.0, 600.0)  # far outside the town: nothing but ground and sky
    depth = images(empty, full(x_m=0.0, z_m=2.0))["camera_front_depth"]
    for row in (120, 150, 199):
        assert depth[row, 7] == pytest.approx(2.0 * 160.0 / (row + 0.5 - 100.0), rel=1e-4)
    assert (depth[:100] == FAR_M).all()


def test_a_pitched_camera_sees_the_ground_where_geometry_says(empty):
    """Straight down by 30 degrees from 2 m: the middle row meets the ground at 4 m."""
    place(empty, 0, 600.0, 600.0)
    rig = full(height=201, x_m=0.0, z_m=2.0, pitch_rad=-math.radians(30.0))
    depth = images(empty, rig)["camera_front_depth"]
    assert depth[100, 100] == pytest.approx(4.0, rel=1e-3)


def test_a_camera_that_looks_straight_down_sees_level_ground_at_one_depth(empty):
    """From 20 m: 20 m to every pixel, whichever way its row looks."""
    place(empty, 0, 600.0, 600.0)
    depth = images(empty, full(height=201, x_m=0.0, z_m=20.0, pitch_rad=-math.pi / 2.0))
    np.testing.assert_allclose(depth["camera_front_depth"], 20.0, atol=1e-3)


@pytest.mark.parametrize("yaw_deg", [0.0, 37.0, -90.0, 180.0])
def test_project_agrees_with_the_image(empty, yaw_deg):
    """A motorcycle is found where `CameraConfig.project` says that its middle is."""
    yaw = math.radians(yaw_deg)
    place(empty, 0, 600.0, 600.0, yaw=0.4)
    ahead, right = (
        12.0 * math.cos(yaw) - 2.0 * math.sin(yaw),
        12.0 * math.sin(yaw) + 2.0 * math.cos(yaw),
    )
    c, s = math.cos(0.4), math.sin(0.4)
    place(
        empty, 1, 600.0 + c * ahead - s * right, 600.0 + s * ahead + c * right,
        kind=ActorKind.CAR, half_length=0.5, half_width=0.5, height=1.0,
    )  # fmt: skip
    rig = full(x_m=0.0, yaw_rad=yaw)
    mask = images(empty, rig)["camera_front_instance"] == 2
    ((column, row, depth),) = rig.cameras[0].project(np.array([[ahead, right, 0.5]]))
    rows, columns = np.nonzero(mask)
    assert columns.mean() + 0.5 == pytest.approx(column, abs=1.0)
    assert rows.mean() + 0.5 == pytest.approx(row, abs=1.0)
    assert depth == pytest.approx(12.0)


def test_lane_lines_are_seen_within_a_pixel_of_where_the_lane_network_has_them(town, empty):
    """The dashes to the right of a straight lane, 6 to 30 m ahead, in the paper's front camera."""
    lanes = town.lanes
    straight = (lanes.kind == LaneKind.DRIVING) & (lanes.junction < 0) & (lanes.right >= 0)
    for lane in np.flatnonzero(straight & (lanes.length_m > 60.0)):
        rows = np.arange(lanes.first[lane], lanes.first[lane] + lanes.count[lane])
        if np.ptp(lanes.points[rows, 3]) < 1e-3 and (lanes.points[rows, 2] < 0.01).all():
            break
    x, y, z, yaw = lanes.points[rows[10]]
    place(empty, 0, x, y, z, yaw)
    camera = RIGS["paper"].cameras[0]
    rgb = images(empty, Rig(cameras=(camera,)))["camera_front"].astype(int).sum(axis=2)
    ahead = rows[10] + np.arange(14, 62)
    dash = (lanes.road_m[ahead] % 9.0 > 1.0) & (lanes.road_m[ahead] % 9.0 < 2.0)
    ahead = ahead[dash & (lanes.change[ahead] & 2 != 0)]
    assert ahead.size >= 4
    reach = lanes.width_m[ahead] / 2.0
    px = lanes.points[ahead, 0] - np.sin(lanes.points[ahead, 3]) * reach - x
    py = lanes.points[ahead, 1] + np.cos(lanes.points[ahead, 3]) * reach - y
    c, s = math.cos(yaw), math.sin(yaw)
    ego = np.stack([c * px + s * py, c * py - s * px, np.zeros(len(px))], axis=1)
    for column, row, depth in camera.project(ego):
        wide = math.ceil(0.6 * camera.focal_px / depth)  # 0.6 m to each side
        middle = int(column)
        part = rgb[int(row), middle - wide : middle + wide + 1].astype(float)
        weight = np.maximum(part - (part.min() + 0.3 * np.ptp(part)), 0.0)
        found = (weight * (np.arange(middle - wide, middle + wide + 1) + 0.5)).sum() / weight.sum()
        # the line slants: where it is in the middle of that row of pixels
        at_row = 800.0 + (column - 800.0) * (int(row) + 0.5 - 450.0) / (row - 450.0)
        assert np.ptp(part) > 40.0
        assert found == pytest.approx(at_row, abs=1.0)


LIGHTS = (LightState.RED, LightState.YELLOW, LightState.GREEN)


def lit(town, empty, rig, weather, metres, every=1):
    """Each light alone, seen from each of its lanes: stop line, then the three pictures by state.

    `metres` from the ego's bumper to the stop line; every so many stop lines.
    """
    signals, record = town.signals, empty.save().record
    state = views_of(record)
    cameras = CameraRig(town, rig, PRESETS[weather])
    cameras.start(SimpleNamespace(state=state))  # a state of its own, to write into
    stops = np.flatnonzero(signals.kind[signals.stop_signal] == SignalKind.LIGHT)[::every]
    for stop in stops.tolist():
        x, y, z, yaw = signals.stop_pose[stop]
        back = metres + float(state.half_length[0])
        state.x[0], state.y[0] = x - back * math.cos(yaw), y - back * math.sin(yaw)
        state.z[0], state.yaw[0] = z, yaw
        pictures = {}
        for shown in (LightState.NONE, *LIGHTS):
            state.light[:] = LightState.NONE
            state.light[signals.stop_signal[stop]] = shown
            pictures[shown] = cameras.observe()["camera_front"].astype(int)
        yield stop, pictures


def lamps_differ(pictures):
    """By how many grey levels, in the channels that tell the three lights from each other."""
    red, yellow, green = (pictures[light] for light in LIGHTS)
    return min(
        (red - green)[..., 0].max(),
        (green - red)[..., 1].max(),
        (yellow - red)[..., 1].max(),
        (yellow - green)[..., 0].max(),
    )


LIT = {  # the colour of a lamp that shines
    LightState.RED: (255, 15, 13),
    LightState.YELLOW: (255, 199, 13),
    LightState.GREEN: (25, 255, 76),
}


def bloom_px(pictures, light):
    """Width of a disc that covers as many pixels with a lamp's colour as the lamp has covered."""
    behind = pictures[LightState.NONE]
    towards = np.array(LIT[light]) - behind
    cover = ((pictures[light] - behind) * towards).sum(axis=2) / (towards**2).sum(axis=2)
    row, column = np.unravel_index(cover.argmax(), cover.shape)
    near = cover[max(0, row - 2) : row + 3, max(0, column - 2) : column + 3]
    return 2.0 * math.sqrt(near.clip(0.0).sum() / math.pi)


@pytest.mark.parametrize(
    ("metres", "weather"),
    [
        (0.0, "ClearNoon"),
        (0.0, "HardRainNoon"),
        (0.0, "ClearNight"),
        (0.0, "HardRainNight"),
        (20.0, "ClearNoon"),
        (20.0, "HardRainNight"),
    ],
)
def test_small_cameras_read_every_light_of_the_town_from_its_stop_line(
    town, empty, weather, metres
):
    """With the bumper at the line and 20 m before it, a lamp is less than a pixel wide."""
    rig = Rig(cameras=RIGS["small"].cameras[:1])
    seen = 0
    for stop, pictures in lit(town, empty, rig, weather, metres):
        assert lamps_differ(pictures) > 60, stop
        assert min(bloom_px(pictures, light) for light in LIGHTS) >= 1.5, stop
        seen += 1
    assert seen > 100


@pytest.mark.parametrize("weather", ["ClearNoon", "HardRainNight"])
def test_the_papers_cameras_read_lights_20_m_before_the_stop_line(town, empty, weather):
    rig = Rig(cameras=RIGS["paper"].cameras[:1])
    for stop, pictures in lit(town, empty, rig, weather, 20.0, every=29):
        assert lamps_differ(pictures) > 60, stop


def test_a_lamp_is_not_seen_from_behind(town, empty):
    scene = scene_of(town)
    lamp = 3  # the red one of the first light's far head, which hangs free
    x, y, z, yaw = scene.lamps.pose[lamp]
    for side, seen in ((-1.0, True), (1.0, False)):  # it shines against its yaw
        place(empty, 0, x + side * 6.0 * math.cos(yaw), y + side * 6.0 * math.sin(yaw), 0.0, yaw)
        towards = full(z_m=z, x_m=0.0, yaw_rad=0.0 if seen else math.pi)
        pictures = []
        for shown in (LightState.NONE, LightState.RED):
            snapshot = empty.save()
            views_of(snapshot.record).light[:] = LightState.NONE
            views_of(snapshot.record).light[scene.lamps.signal[lamp]] = shown
            empty.restore(snapshot)
            pictures.append(images(empty, towards)["camera_front"].astype(int))
        middle = (pictures[1] - pictures[0])[92:108, 152:168]
        assert (middle.max() > 60) == seen


def test_every_weather_looks_different_and_none_is_blank(town, empty):
    place(empty, 0, *before_stop_line(town, 12.0))
    seen = {name: images(empty, "small", name)["camera_front"] for name in PRESETS}
    assert len({image.tobytes() for image in seen.values()}) == len(PRESETS)
    for name, image in seen.items():
        assert image.std() > 8.0, name
    assert seen["ClearNight"].mean() < 0.5 * seen["ClearNoon"].mean()


def test_below_the_deck_one_sees_the_deck_and_on_it_the_road(town, empty):
    points = town.lanes.points
    high = points[points[:, 2] > 9.0][200]
    place(empty, 0, *high)
    rig = full()
    on_top = images(empty, rig)["camera_front_semantic"]
    assert on_top[190, 160] in (Tag.ROADS, Tag.ROAD_LINES)
    place(empty, 0, high[0], high[1], 0.0, high[3])
    assert images(empty, rig)["camera_front_semantic"][5, 160] == Tag.BRIDGE


def test_depth_semantic_and_instance_do_not_change_the_picture(town, empty):
    place(empty, 0, *before_stop_line(town, 9.0))
    camera = CameraConfig(name="camera_front", width=200, height=120)
    plain = images(empty, Rig(cameras=(camera,)), "WetNoon")
    rich = images(
        empty, Rig(cameras=(camera,), depth=True, semantic=True, instance=True), "WetNoon"
    )
    np.testing.assert_array_equal(plain["camera_front"], rich["camera_front"])
    assert set(plain) == {"camera_front"}
    assert np.isfinite(rich["camera_front_depth"]).all()
    assert (rich["camera_front_depth"] > 0.0).all()
    assert rich["camera_front_semantic"].max() <= max(Tag)


_DIGEST = """
import gymnasium, hashlib, di_envs
env = gymnasium.make("DriveInsight-Toy-v1", observations=("camera",), weather="HardRainNoon")
observation, _ = env.reset(seed=5)
digest = hashlib.sha256()
for _ in range(3):
    observation = env.step(env.action_space.high)[0]
    for name in sorted(observation):
        digest.update(observation[name].tobytes())
print(digest.hexdigest())
"""


def test_the_same_seed_gives_the_same_bits_in_two_processes():
    run = [
        subprocess.run([sys.executable, "-c", _DIGEST], capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    assert run[0].stdout == run[1].stdout
    assert len(run[0].stdout.strip()) == 64


def test_the_same_bits_come_after_restore():
    env = gymnasium.make("DriveInsight-Toy-v1", observations=("camera",), weather="SoftRainSunset")
    env.reset(seed=8)
    snapshot = di_envs.save(env)

    def drive():
        digest = hashlib.sha256()
        for _ in range(3):
            observation, *_ = env.step(np.array([0.5, 0.1, 0.0], np.float32))
            assert env.observation_space.contains(observation)
            digest.update(b"".join(observation[name].tobytes() for name in sorted(observation)))
        return digest.hexdigest()

    first = drive()
    di_envs.restore(env, snapshot)
    assert drive() == first
    env.close()


def test_an_observation_is_a_fresh_array_each_time(empty):
    cameras = CameraRig(empty.town, RIGS["rl"], PRESETS["ClearNoon"])
    cameras.start(empty.view)
    first, second = cameras.observe(), cameras.observe()
    assert not np.shares_memory(first["camera_front"], second["camera_front"])
    np.testing.assert_array_equal(first["camera_front"], second["camera_front"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"width": 0}, "width of 1 to 8192 pixels; got 0"),
        ({"height": -3}, "height of 1 to 8192"),
        ({"height": 2.5}, "height of 1 to 8192"),
        ({"width": "wide"}, "width must be a number; got 'wide'"),
        ({"height": math.nan}, "height of 1 to 8192"),
        ({"fov_deg": "150"}, "fov_deg must be a number; got '150'"),
        ({"z_m": None}, "z_m must be a number; got None"),
        ({"fov_deg": 0.0}, "between 0 and 180 degrees"),
        ({"fov_deg": 180.0}, "between 0 and 180 degrees"),
        ({"fov_deg": math.nan}, "between 0 and 180 degrees"),
        ({"pitch_rad": 10.0}, "Is it in degrees"),
        ({"x_m": math.inf}, "x_m must be a finite number"),
    ],
)
def test_an_impossible_camera_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        CameraConfig(name="camera_front", **options)


def test_unknown_and_empty_rigs_are_refused():
    with pytest.raises(ValueError, match=r"'smal'; did you mean 'small'\?"):
        rig_of("smal")
    with pytest.raises(ValueError, match="names of their own"):
        Rig(cameras=())
    with pytest.raises(ValueError, match="names of their own"):
        Rig(cameras=(CameraConfig(name="a"), CameraConfig(name="a")))


def test_shipped_rigs_have_the_sizes_that_are_documented():
    sizes = {name: {(c.width, c.height) for c in rig.cameras} for name, rig in RIGS.items()}
    assert sizes == {
        "small": {(256, 144)},
        "driveinsight": {(256, 144), (320, 128)},
        "paper": {(1600, 900)},
        "rl": {(84, 84)},
    }
    assert [camera.name for camera in RIGS["paper"].cameras] == [
        f"camera_{side}" for side in ("front", "left", "right", "back")
    ]
    np.testing.assert_allclose(
        RIGS["paper"].cameras[0].intrinsics(),
        [
            [800 / math.tan(math.radians(75)), 0, 800],
            [0, 800 / math.tan(math.radians(75)), 450],
            [0, 0, 1],
        ],
    )
