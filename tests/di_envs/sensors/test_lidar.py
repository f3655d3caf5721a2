"""LiDAR: ranges and rings by arithmetic, agreement with the camera, drops and noise, bits."""

from __future__ import annotations

import hashlib
import math
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

import di_envs
from di_envs.observation import observation_space
from di_envs.sensors.camera.cameras import CameraRig
from di_envs.sensors.camera.config import CameraConfig, Rig
from di_envs.sensors.lidar.config import LIDARS, LidarConfig, lidar_of
from di_envs.sensors.lidar.sweep import Lidar
from di_envs.sensors.scene.scene import box_buffer, collect_boxes, scene_of
from di_envs.sensors.scene.tags import Tag
from di_envs.sensors.weather import weather_of
from di_envs.town.lanes import LaneKind
from di_envs.town.loading import load_town
from di_envs.world.state import ActorKind, views_of
from di_envs.world.world import World, WorldConfig

SURE = {"dropoff": 0.0, "dropoff_zero": 0.0}  # no ray is dropped
LEVEL = {"channels": 3, "upper_deg": 1.0, "lower_deg": -1.0, "x_m": 0.0, "z_m": 1.5, **SURE}


@pytest.fixture(scope="module")
def town():
    return load_town("town05")


@pytest.fixture
def empty(town):
    """An ego far outside the town, and one more vehicle even further."""
    world = World(town, WorldConfig(vehicles=2, walkers=0))
    world.reset(0, [])
    place(world, 0, 600.0, 600.0)
    place(world, 1, 900.0, 900.0)
    return world


@pytest.fixture(scope="module")
def busy(town):
    world = World(town, WorldConfig(vehicles=120, walkers=40))
    world.reset(3, [])
    return world


def place(world, actor, x, y, z=0.0, yaw=0.0, **fields):
    snapshot = world.save()
    state = views_of(snapshot.record)
    for name, value in {"x": x, "y": y, "z": z, "yaw": yaw, **fields}.items():
        getattr(state, name)[actor] = value
    world.restore(snapshot)


def sweep(world, **config):
    """Points (steps, channels, 4), and tags if asked for."""
    lidar = Lidar(world.town, LidarConfig(**config))
    lidar.start(world.view)
    found = lidar.observe()
    size = (lidar.config.steps, lidar.config.channels)
    points = found["lidar"].reshape(*size, 4).astype(np.float64)
    return (points, found["lidar_semantic"].reshape(size)) if lidar.config.semantic else points


def post(world, ahead_m, half_width_m=1.2, yaw=0.0):
    """A post whose face is `ahead_m` ahead of an ego at (600, 600); it fills 0.55 of its box."""
    c, s = math.cos(yaw), math.sin(yaw)
    reach = ahead_m + 0.55
    size = {"half_length": 1.0, "half_width": half_width_m, "height": 3.0}
    at = (600.0 + c * reach, 600.0 + s * reach)
    place(world, 1, *at, yaw=yaw, kind=ActorKind.PROP, **size)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5])
def test_a_post_10_m_ahead_is_hit_at_10_m(empty, yaw):
    place(empty, 0, 600.0, 600.0, yaw=yaw)
    post(empty, 10.0, yaw=yaw)
    points, tags = sweep(empty, steps=3600, semantic=True, **LEVEL)
    assert points[0, 1] == pytest.approx([10.0, 0.0, 1.5, math.exp(-0.04)], abs=1e-5)
    assert tags[0, 1] == Tag.POLES
    assert np.flatnonzero(points[:, 1, 3]).tolist() == [
        step for step in range(3600) if abs(10.0 * math.tan(math.radians(step / 10.0))) <= 0.66
        and not 900 < step < 2700
    ]  # fmt: skip


def test_a_post_to_the_right_is_a_quarter_turn_into_the_sweep(empty):
    place(empty, 0, 600.0, 600.0, yaw=0.3)
    post(empty, 10.0, yaw=0.3 + math.pi / 2.0)
    points = sweep(empty, steps=360, **LEVEL)
    assert points[90, 1, :3] == pytest.approx([0.0, 10.0, 1.5], abs=1e-4)
    assert not points[270, 1].any()


def test_rings_on_the_ground_have_the_radius_height_over_tangent(empty):
    """2.5 m above the ground, a ray 30 degrees down meets it 4.33 m away, one at -2 at 71.6 m."""
    config = LIDARS["paper"]
    points = sweep(empty, **SURE)
    elevation = np.radians(10.0 - 40.0 / 31.0 * np.arange(32))
    assert elevation[-1] == pytest.approx(math.radians(-30.0))
    for channel, angle in enumerate(elevation):
        far = 2.5 / -math.sin(angle) if angle < 0.0 else math.inf
        if far > config.range_m:
            assert not points[:, channel].any()
            continue
        radius = np.hypot(points[:, channel, 0] - config.x_m, points[:, channel, 1])
        assert radius == pytest.approx(2.5 / math.tan(-angle), rel=1e-4)
        assert points[:, channel, 2] == pytest.approx(0.0, abs=1e-4)
        assert points[:, channel, 3] == pytest.approx(math.exp(-0.004 * far), rel=1e-5)


def test_a_box_shadows_the_ground_behind_it(empty):
    post(empty, 10.0)
    points = sweep(empty, steps=360, x_m=0.0, **SURE)
    radius = np.hypot(points[0, :, 0], points[0, :, 1])
    hit = points[0, :, 3] > 0.0
    assert radius[hit].max() == pytest.approx(10.0, abs=1e-4)  # 3 m high: above the LiDAR
    assert np.hypot(*points[180, :, :2].T).max() > 45.0  # the last ring


@pytest.mark.parametrize("at", [(0.0, 0.0, 0.3), (1.3, 0.0, 2.5), (-1.0, 0.4, 0.8)])
def test_the_ego_is_not_hit(empty, at):
    x, y, z = at
    points, tags = sweep(empty, x_m=x, y_m=y, z_m=z, semantic=True, **SURE)
    assert set(np.unique(tags)) == {Tag.NONE, Tag.TERRAIN}
    assert points[..., 2] == pytest.approx(0.0, abs=1e-4)


def ring_over_a_street(town):
    """Where an elevated lane crosses a street on the ground: x, y, yaw of the street, height."""
    points, lanes = town.lanes.points, town.lanes
    of_lane = np.repeat(np.arange(len(lanes.count)), lanes.count)
    driving = lanes.kind[of_lane] == LaneKind.DRIVING
    high, low = points[(points[:, 2] > 4.0) & driving], points[(points[:, 2] < 0.01) & driving]
    high, low = high[::6], low[::6]
    near = np.hypot(*(high[:, None, :2] - low[None, :, :2]).transpose(2, 0, 1))
    across = np.abs(np.sin(high[:, None, 3] - low[None, :, 3])) > 0.9
    i, j = np.unravel_index(np.argmin(np.where(across, near, np.inf)), near.shape)
    assert near[i, j] < 4.0
    return *low[j, [0, 1, 3]], high[i, 2]


def test_below_the_bridge_nothing_is_seen_through_the_deck(town, empty):
    x, y, yaw, height = ring_over_a_street(town)
    place(empty, 0, x, y, 0.0, yaw)
    config = {"steps": 720, "channels": 64, "upper_deg": 60.0, "lower_deg": -30.0, "x_m": 0.0}
    points, tags = sweep(empty, semantic=True, **config, **SURE)
    steep = points[:, 0]  # 60 degrees up: meets a deck 1.7 times nearer than it is high
    assert (steep[:, 3] > 0.0).all()
    assert (steep[:, 2] < height).all()
    assert (tags[:, 0] == Tag.BRIDGE).mean() > 0.95
    over_deck = (points[..., 2] > height + 0.1) & (np.hypot(points[..., 0], points[..., 1]) < 6.0)
    assert not over_deck.any()


def test_on_the_bridge_the_deck_is_road_and_hides_the_street_below(town, empty):
    lanes = town.lanes
    x, y, _, _ = ring_over_a_street(town)
    driving = np.repeat(lanes.kind, lanes.count) == LaneKind.DRIVING
    high = np.flatnonzero((lanes.points[:, 2] > 4.0) & driving)
    nearest = high[np.argmin(np.hypot(*(lanes.points[high, :2] - (x, y)).T))]
    place(empty, 0, *lanes.points[nearest])
    points, tags = sweep(empty, steps=720, semantic=True, **SURE)
    close = np.hypot(points[..., 0], points[..., 1]) < 7.0
    hit = close & (points[..., 3] > 0.0)
    assert hit.sum() > 500
    assert points[hit][:, 2].min() > -0.05  # nothing of the street, 6 m and more below
    lane = hit & (np.abs(points[..., 1]) < 1.2)
    assert lane.sum() > 300
    assert np.isin(tags[lane], (Tag.ROADS, Tag.ROAD_LINES)).all()
    assert (tags[hit] != Tag.TERRAIN).all()


def test_half_of_the_rays_are_dropped_as_carla_drops_them(empty):
    """Of rays to the ground 0.45 never come back; far ones are weaker and drop more often."""
    flat = {"steps": 1800, "upper_deg": -1.8, "lower_deg": -4.0}  # rings of 36 to 80 m
    sure, drops = sweep(empty, **flat, **SURE), sweep(empty, **flat)
    kept = drops[..., 3] > 0.0
    assert (drops[kept] == sure[kept]).all()
    strong, hit = sure[..., 3] > 0.8, sure[..., 3] > 0.0
    assert kept[strong].mean() == pytest.approx(0.55, abs=0.01)
    weak = hit & ~strong
    expected = 0.55 * (0.6 + 0.4 / 0.8 * sure[..., 3][weak])
    assert kept[weak].mean() == pytest.approx(expected.mean(), abs=0.015)
    assert not drops[~kept].any()


def test_noise_moves_points_along_their_rays(empty):
    sure, noisy = sweep(empty, steps=1800, **SURE), sweep(empty, steps=1800, noise_m=0.05, **SURE)
    hit = sure[..., 3] > 0.0
    origin = np.array([1.3, 0.0, 2.5])
    before, after = sure[hit][:, :3] - origin, noisy[hit][:, :3] - origin
    moved = np.linalg.norm(after, axis=1) - np.linalg.norm(before, axis=1)
    near = np.linalg.norm(before, axis=1) < 80.0
    assert moved[near].mean() == pytest.approx(0.0, abs=0.002)
    assert moved[near].std() == pytest.approx(0.05, rel=0.03)
    aside = np.linalg.norm(np.cross(before, after), axis=1) / np.linalg.norm(before, axis=1)
    assert aside.max() < 1e-3
    assert (noisy[..., 3] == sure[..., 3]).all()


def test_drops_depend_on_tick_and_seed_alone(town):
    world = World(town, WorldConfig(vehicles=0, walkers=0))
    kept = []
    for seed, ticks in ((1, 0), (2, 0), (1, 0), (1, 1)):
        world.reset(seed, [])
        place(world, 0, 600.0, 600.0)
        snapshot = world.save()
        views_of(snapshot.record).tick[...] += ticks
        world.restore(snapshot)
        kept.append(sweep(world)[..., 3] > 0.0)
    assert (kept[0] == kept[2]).all()
    assert 0.3 < (kept[0] != kept[1])[:, 20:].mean() < 0.7
    assert 0.3 < (kept[0] != kept[3])[:, 20:].mean() < 0.7


@pytest.mark.parametrize("number", range(4))
def test_hits_agree_with_the_depth_and_tags_that_the_camera_shows(busy, number):
    """At four places of a busy town: a point's own pixel shows its tag, and its depth within 2 %.

    A camera looks through the middle of a pixel and the ray passes beside it, so at silhouettes
    they may meet different things. Pixels are small here, so these are few; and they all lie at
    silhouettes: some pixel beside shows what the ray met.
    """
    traffic = np.flatnonzero(busy.view.state.kind[: 1 + 120])
    state, actor = busy.view.state, traffic[7 + 23 * number]
    pose = (state.x[actor], state.y[actor], state.z[actor] + 1.5, state.yaw[actor])
    place(busy, 0, *pose)
    points, tags = sweep(busy, channels=32, steps=720, x_m=0.0, semantic=True, **SURE)
    side = 2000
    cameras = tuple(
        CameraConfig(name=f"camera_{k}", width=side, height=side, fov_deg=90.0, x_m=0.0, z_m=2.5,
                     yaw_rad=k * math.pi / 2.0)
        for k in range(4)
    )  # fmt: skip
    rig = CameraRig(
        busy.town, Rig(cameras=cameras, depth=True, semantic=True), weather_of("ClearNoon")
    )
    rig.start(busy.view)
    images = rig.observe()
    hit = points[..., 3] > 0.0
    close, same, beside, total = 0, 0, 0, 0
    for camera in cameras:
        column, row, depth = camera.project(points[hit][:, :3]).T
        inside = (np.minimum(column, row) >= 1) & (np.maximum(column, row) < side - 1)
        seen = (depth > 0.5) & inside
        i, j, met = row[seen].astype(int), column[seen].astype(int), tags[hit][seen]
        shown = images[f"{camera.name}_semantic"]
        total += seen.sum()
        near = np.abs(images[f"{camera.name}_depth"][i, j] - depth[seen]) <= 0.02 * depth[seen]
        close, same = close + near.sum(), same + (shown[i, j] == met).sum()
        round_it = [shown[i + di, j + dj] == met for di in (-1, 0, 1) for dj in (-1, 0, 1)]
        beside += np.any(round_it, axis=0).sum()
    assert total > 5000
    assert same / total >= 0.99
    assert close / total >= 0.99
    assert beside / total >= 0.999


def test_each_tick_scans_the_half_of_the_sweep_that_is_its_turn(busy):
    """Of 175 steps an odd tick sees 0 to 87, an even one 87 to 174, as a whole sweep shows them."""
    config = LidarConfig(semantic=True, noise_m=0.02)
    whole, half = Lidar(busy.town, config), Lidar(busy.town, config, half_sweeps=True)
    for _ in range(3):
        whole.start(busy.view)
        half.start(busy.view)
        odd = int(busy.view.state.tick) % 2 == 1
        rows = slice(0, 88 * 32) if odd else slice(87 * 32, None)
        expected, found = whole.observe(), half.observe()
        assert found["lidar"].shape == (2816, 4)
        assert (found["lidar"] == expected["lidar"][rows]).all()
        assert (found["lidar_semantic"] == expected["lidar_semantic"][rows]).all()
        side = found["lidar"][found["lidar"][:, 3] > 0.0][:, 1].astype(np.float64)
        # to the right at odd ticks, y being right; step 87 is 1 degree before straight behind
        assert (side if odd else -side).min() > -85.0 * math.sin(math.radians(1.1))
        busy.advance(np.zeros((0, 3)), 1)


@pytest.mark.parametrize(
    ("control_dt_s", "rows"), [(0.05, 2816), (0.1, 5600), (0.15, 5600), (0.5, 5600)]
)
def test_an_environment_of_20_hz_sees_half_sweeps_and_slower_ones_whole_ones(control_dt_s, rows):
    env = gymnasium.make("DriveInsight-Toy-v1", observations=("lidar",), control_dt_s=control_dt_s)
    seen, _ = env.reset(seed=1)
    for expected_tick in range(2):
        assert seen["lidar"].shape == env.observation_space["lidar"].shape == (rows, 4)
        assert env.observation_space.contains(seen)
        points = seen["lidar"][seen["lidar"][:, 3] > 0.0]
        if rows == 2816:
            right = (points[:, 1] > 0.0).mean()
            assert (right > 0.98) if expected_tick == 1 else (right < 0.02)
        seen = env.step(np.array([0.0, 0.0, 1.0], np.float32))[0]


def nearest_by_brute_force(world, config):
    """Range of every ray (steps, channels) against the plane and each box, in double precision."""
    boxes, state = box_buffer(), world.view.state
    scene = scene_of(world.town)
    collect_boxes(scene, state, 0, config.reach_m, boxes)
    elevation = np.radians(np.linspace(config.upper_deg, config.lower_deg, config.channels))
    azimuth = state.yaw[0] + 2.0 * np.pi * np.arange(config.steps)[:, None] / config.steps
    flat = np.cos(elevation)
    up = np.broadcast_to(np.sin(elevation), (config.steps, config.channels))
    rays = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), up], axis=2)
    origin = np.array([state.x[0], state.y[0], state.z[0] + config.z_m])
    with np.errstate(divide="ignore"):
        nearest = np.where(up < 0.0, (scene.base_z[0] - origin[2]) / up, np.inf)
        for box in range(boxes.count[0]):
            yaw, pitch = float(boxes.yaw[box]), float(boxes.pitch[box])
            c, s, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
            axes = np.array([[c * cp, s * cp, sp], [-s, c, 0.0], [-c * sp, -s * sp, cp]])
            start, along = axes @ (origin - boxes.centre[box]), rays @ axes.T
            one, other = (-boxes.half[box] - start) / along, (boxes.half[box] - start) / along
            enter, leave = np.minimum(one, other).max(axis=2), np.maximum(one, other).min(axis=2)
            met = (enter <= leave) & (enter > 0.05)
            nearest = np.where(met, np.minimum(nearest, enter), nearest)
    return np.where(nearest <= config.range_m, nearest, 0.0), boxes


@pytest.mark.parametrize("where", ["street", "ramp", "below"])
def test_no_hit_is_left_out_or_added_beside_testing_every_ray_with_every_box(town, busy, where):
    points = town.lanes.points
    poses = {
        "street": points[np.flatnonzero(points[:, 2] < 0.01)[1234]],
        "ramp": points[np.argmin(np.abs(points[:, 2] - 3.0))],
        "below": np.insert(ring_over_a_street(town)[:3], 2, 0.0),
    }
    place(busy, 0, *poses[where])
    config = LidarConfig(channels=24, steps=120, x_m=0.0, upper_deg=25.0, **SURE)
    expected, boxes = nearest_by_brute_force(busy, config)
    if where == "ramp":
        assert (boxes.pitch[: boxes.count[0]] != 0.0).any()
    lidar = Lidar(town, config)
    lidar.start(busy.view)
    found = lidar.observe()["lidar"].reshape(120, 24, 4).astype(np.float64)
    far = np.linalg.norm(found[..., :3] - (0.0, 0.0, 2.5), axis=2) * (found[..., 3] > 0.0)
    differ = np.abs(far - expected) > 1e-3 * np.maximum(expected, 1.0)
    assert differ.mean() < 0.001  # single precision may miss a box by a hair, at its very edge
    assert (expected > 0.0).mean() > 0.4


BITS = """
import hashlib
from di_envs.sensors.lidar.sweep import Lidar
from di_envs.sensors.lidar.config import LidarConfig
from di_envs.town.loading import load_town
from di_envs.world.world import World, WorldConfig
world = World(load_town("town05"), WorldConfig(vehicles=120, walkers=40))
world.reset(3, [])
lidar = Lidar(world.town, LidarConfig(noise_m=0.02, semantic=True))
lidar.start(world.view)
found = lidar.observe()
print(hashlib.sha256(found["lidar"].tobytes() + found["lidar_semantic"].tobytes()).hexdigest())
"""


def test_another_process_sees_the_same_bits(town):
    world = World(town, WorldConfig(vehicles=120, walkers=40))
    world.reset(3, [])
    lidar = Lidar(town, LidarConfig(noise_m=0.02, semantic=True))
    lidar.start(world.view)
    found = lidar.observe()
    here = hashlib.sha256(found["lidar"].tobytes() + found["lidar_semantic"].tobytes()).hexdigest()
    there = subprocess.run([sys.executable, "-c", BITS], capture_output=True, text=True, check=True)
    assert there.stdout.strip() == here


def test_the_same_bits_are_seen_after_a_restore_and_all_lie_in_the_space():
    config = LidarConfig(noise_m=0.5, semantic=True)
    env = gymnasium.make(
        "DriveInsight-Town05Tiny-v1", observations=("lidar", "prompt"), lidar=config
    )
    seen, _ = env.reset(seed=5)
    assert seen["lidar"].shape == (5600, 4)
    snapshot = di_envs.save(env)
    first = []
    for _ in range(8):
        seen = env.step(env.action_space.high)[0]
        assert env.observation_space.contains(seen)
        first.append(seen["lidar"])
    di_envs.restore(env, snapshot)
    for sweep_before in first:
        assert (env.step(env.action_space.high)[0]["lidar"] == sweep_before).all()
    assert not (first[0] == first[1]).all()


@pytest.mark.parametrize("name", LIDARS)
def test_each_preset_lies_in_its_space(busy, name):
    space = observation_space(("lidar",), lidar=name)
    lidar = Lidar(busy.town, LIDARS[name])
    lidar.start(busy.view)
    found = lidar.observe()
    assert space.contains(found)
    assert np.isfinite(found["lidar"]).all()
    rays = {"paper": 5600, "leaderboard": 59968, "dense": 57600}[name]
    assert found["lidar"].shape == (rays, 4)
    assert (found["lidar"][:, 3] > 0.0).mean() > 0.2


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"channels": 0}, "channels"),
        ({"steps": 1.5}, "steps"),
        ({"upper_deg": -40.0}, "upper_deg down to lower_deg"),
        ({"lower_deg": -90.0}, "80 degrees"),
        ({"range_m": 0.0}, "got 0.0"),
        ({"dropoff": 1.2}, "dropoff is a share"),
        ({"noise_m": math.nan}, "noise_m"),
        ({"z_m": 250.0}, "z_m=250.0"),
    ],
)
def test_impossible_lidars_are_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        LidarConfig(**fields)


def test_an_unknown_preset_is_refused_with_a_suggestion():
    with pytest.raises(ValueError, match="did you mean 'leaderboard'"):
        lidar_of("leaderbord")
