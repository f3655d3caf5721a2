"""The prompt: each component by arithmetic, and none of them telling what another tells."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import booleans, floats, integers

from di_envs.observation import observation_space
from di_envs.prompt import COMPONENTS, MAP_POLYLINES, OBSTACLES, empty_prompt
from di_envs.prompt_filling import fill_speed_history
from di_envs.town.lanes import LaneKind, LightState, SignalKind
from di_envs.town.map_chunks import POINTS, RANGE_M, MapKind, build_map_chunks
from di_envs.town.plan import RoadOption
from di_envs.world.state import HISTORY_LENGTH, ActorKind
from tests.hand_made import VEHICLES, Scene, toy_plan, toy_town

PI = math.pi


@pytest.fixture(scope="module")
def town():
    return toy_town()


@pytest.fixture(scope="module")
def plan(town):
    return toy_plan(town)


@pytest.fixture
def scene(town, plan):
    return Scene(town, plan)


# ---- obstacles


def test_an_obstacle_is_seen_ahead_and_to_the_right(scene):
    scene.put(0, 100.0, 50.0, yaw=PI / 2)  # facing south: ahead is +y, right is -x
    scene.put(1, 97.0, 60.0, yaw=PI, speed=5.0, kind=ActorKind.BUS)  # driving west
    seen = scene.observe()["obstacles"]
    expected = [10.0, 3.0, PI / 2, 4.0, 2.0, 0.0, 5.0, ActorKind.BUS, 1.0]
    np.testing.assert_allclose(seen[0], expected, atol=1e-5)
    assert not seen[1:].any()


def test_velocities_are_over_the_ground_whatever_the_ego_does(scene):
    scene.put(0, 0.0, 0.0, speed=0.0)
    scene.put(1, 10.0, 0.0, speed=7.0)
    standing = scene.observe()["obstacles"]
    scene.put(0, 0.0, 0.0, speed=12.0)
    assert scene.observe()["obstacles"].tobytes() == standing.tobytes()
    assert standing[0, 5] == 7.0


def test_the_nearest_32_come_first_and_the_rest_are_left_out(scene):
    scene.put(0, 0.0, 0.0)
    for k in range(VEHICLES):
        scene.put(1 + k, 0.0, 40.0 - k)  # the last put is the nearest
    seen = scene.observe()["obstacles"]
    assert seen[:, 1].tolist() == [float(d) for d in range(1, OBSTACLES + 1)]
    assert seen[:, 8].all()


def test_equally_near_obstacles_come_in_the_order_of_their_ids(scene):
    scene.put(0, 0.0, 0.0)
    for actor, (x, y) in enumerate([(5.0, 0.0), (0.0, 5.0), (-5.0, 0.0)], start=1):
        scene.put(actor, x, y)
    seen = scene.observe()["obstacles"][:3, :2]
    np.testing.assert_allclose(seen, [[5, 0], [0, 5], [-5, 0]], atol=1e-6)


@pytest.mark.parametrize(("z", "count"), [(3.0, 1), (3.01, 0), (-3.01, 0)])
def test_who_is_on_another_level_is_left_out(scene, z, count):
    scene.put(0, 0.0, 0.0)
    scene.put(1, 5.0, 0.0, z=z)
    assert scene.observe()["obstacles"][:, 8].sum() == count


@pytest.mark.parametrize(("x", "count"), [(79.9, 1), (80.1, 0)])
def test_obstacles_are_seen_to_eighty_metres(scene, x, count):
    scene.put(0, 0.0, 0.0)
    scene.put(1, x, 0.0)
    assert scene.observe()["obstacles"][:, 8].sum() == count


def test_poles_are_no_obstacles_as_they_would_give_the_signals_away(scene):
    scene.put(0, 0.0, 0.0)
    scene.put(1, 5.0, 0.0, kind=ActorKind.PROP)
    assert not scene.observe()["obstacles"].any()


# ---- lights and signs


def test_every_stop_line_of_a_light_nearby_is_told_with_its_colour(scene, town):
    scene.put(0, -30.0, -48.25, yaw=0.0)
    scene.state.light[:] = [int(LightState.RED)] * town.signals.kind.size
    facing = town.signals.stop_signal[0]
    scene.state.light[facing] = LightState.GREEN
    seen = scene.observe()["traffic_lights"]
    lines = np.flatnonzero(town.signals.kind[town.signals.stop_signal] == SignalKind.LIGHT)
    gap = np.hypot(*(town.signals.stop_pose[lines, :2] - [-30.0, -48.25]).T)
    assert seen[:, 4].sum() == (gap <= 50.0).sum() > 2  # of all arms, not of the route's alone
    near = np.hypot(seen[:, 0], seen[:, 1])[seen[:, 4] == 1]
    np.testing.assert_allclose(near, np.sort(gap[gap <= 50.0]), rtol=1e-6)
    x, y, _, yaw = town.signals.stop_pose[0]
    own = np.flatnonzero(np.isclose(seen[:, 0], x + 30.0) & np.isclose(seen[:, 1], y + 48.25))
    assert seen[own[0], 3] == LightState.GREEN
    assert seen[own[0], 2] == pytest.approx(yaw, abs=1e-6)
    assert set(seen[seen[:, 4] == 1][:, 3]) == {LightState.GREEN, LightState.RED}


def test_a_stop_sign_is_told_where_its_line_is(scene, town):
    line = np.flatnonzero(town.signals.kind[town.signals.stop_signal] == SignalKind.STOP)[0]
    x, y, z, yaw = town.signals.stop_pose[line]
    scene.put(0, x - 10.0 * math.cos(yaw), y - 10.0 * math.sin(yaw), z, yaw)
    np.testing.assert_allclose(scene.observe()["stop_signs"][0], [10, 0, 0, 1], atol=1e-5)
    assert not scene.observe()["stop_signs"][1:].any()


def test_signals_out_of_reach_are_not_told(scene):
    scene.put(0, 500.0, 500.0)
    seen = scene.observe()
    assert not seen["traffic_lights"].any()
    assert not seen["stop_signs"].any()
    assert not seen["map"].any()


# ---- route


def test_routing_begins_after_the_point_that_is_reached(scene, plan):
    x, y, z, yaw = plan.points[3]
    scene.put(0, x, y, z, yaw)
    scene.state.route_index[0] = 3
    seen = scene.observe()["routing"]
    steps = plan.points[4:54, :2] - plan.points[3, :2]
    ahead = steps @ [math.cos(yaw), math.sin(yaw)]
    np.testing.assert_allclose(seen[:, 0], ahead, atol=1e-4)
    assert seen[:, 3].all()


def test_routing_is_empty_behind_the_routes_end(scene, plan):
    scene.state.route_index[0] = len(plan.points) - 3
    seen = scene.observe()["routing"]
    assert seen[:2, 3].all()
    assert not seen[2:].any()


def test_the_command_is_the_option_at_the_next_target_point(scene, plan):
    for target in range(len(plan.targets)):
        scene.state.target_index[0] = target
        seen = scene.observe()
        point = plan.targets[target]
        assert seen["command"] == max(plan.option[point], 0)
        dx, dy = plan.points[point, :2] - plan.points[0, :2]
        assert math.hypot(*seen["target_point"][:2]) == pytest.approx(math.hypot(dx, dy), rel=1e-5)


def test_void_is_told_as_no_command(scene, plan):
    void = dataclasses.replace(plan, option=np.full_like(plan.option, RoadOption.VOID))
    assert scene.observe(plan=void)["command"] == 0


# ---- speeds


def test_past_speeds_are_those_of_half_a_second_steps_without_the_present_one():
    ring = np.array([1000.0] * HISTORY_LENGTH)
    for tick in range(101):
        ring[tick % HISTORY_LENGTH] = tick / 2.0  # the speed at a tick is half its number
    out = empty_prompt().speed_history
    fill_speed_history(ring, 100, out)
    assert out.tolist() == [45.0, 40.0, 35.0, 30.0]  # ticks 90, 80, 70 and 60


def test_before_the_episode_began_the_speed_was_zero():
    out = empty_prompt().speed_history
    fill_speed_history(np.full(HISTORY_LENGTH, 9.0), 20, out)
    assert out.tolist() == [9.0, 9.0, 0.0, 0.0]  # ticks 10, 0, -10 and -20


# ---- map


def test_the_map_holds_the_nearest_polylines_in_the_order_of_their_distance(scene, town):
    chunks = build_map_chunks(town.lanes)
    scene.put(0, -12.0, -30.0, yaw=0.7)
    seen = scene.observe()["map"]
    gap = np.hypot(*np.moveaxis(chunks.points[:, :, :2] - [-12.0, -30.0], 2, 0)).min(axis=1)
    expected = np.sort(gap[gap <= RANGE_M])[:MAP_POLYLINES]
    told = np.hypot(seen[:, :, 0], seen[:, :, 1]).min(axis=1)
    np.testing.assert_allclose(told[: len(expected)], expected, atol=1e-4)
    assert seen[: len(expected), :, 3].all()
    assert not seen[len(expected) :].any()


def test_polylines_cover_every_driving_lane_and_meet_at_their_ends(town):
    chunks, lanes = build_map_chunks(town.lanes), town.lanes
    centre = chunks.points[(chunks.kind == MapKind.LANE_CENTRE).all(axis=1)]
    lengths = np.linalg.norm(np.diff(centre[:, :, :2], axis=1), axis=2).sum(axis=1)
    driving = lanes.kind == LaneKind.DRIVING
    assert lengths.sum() == pytest.approx(lanes.length_m[driving].sum(), rel=2e-3)
    assert lengths.max() <= (POINTS - 1) * 2.0 + 1e-6


def test_a_line_lies_half_a_lane_beside_the_centre(scene, town):
    lane = int(np.flatnonzero((town.lanes.kind == LaneKind.DRIVING) & (town.lanes.right < 0))[0])
    middle = town.lanes.first[lane] + town.lanes.count[lane] // 2
    scene.put(0, *town.lanes.points[middle])
    seen = scene.observe()["map"]
    beside = seen[np.abs(seen[:, :, 0]).min(axis=1) < 1.5]  # those that pass by the ego
    offsets = {
        (round(float(row[np.abs(row[:, 0]).argmin(), 1]), 1), int(row[0, 2])) for row in beside
    }
    half = round(float(town.lanes.width_m[middle]) / 2.0, 1)
    assert (0.0, MapKind.LANE_CENTRE) in offsets
    assert (half, MapKind.SOLID_LINE) in offsets


def test_a_map_below_a_bridge_is_not_told_on_it(scene):
    scene.put(0, -30.0, -48.25, z=5.0)
    assert not scene.observe()["map"].any()


# ---- independence


def moved(array, rows, by):
    """A copy with some rows' first column moved [m]."""
    copy = array.copy()
    copy[rows, 0] += by
    return copy


def edit_command(scene):
    option = scene.plan.option.copy()
    option[scene.plan.targets[0]] = option[scene.plan.targets[0]] % 6 + 1
    return {"plan": dataclasses.replace(scene.plan, option=option)}


def edit_target_point(scene):
    plan = scene.plan
    point = plan.targets[0] + 60  # behind the 50 points of the routing
    option = plan.option.copy()
    option[point] = option[plan.targets[0]]
    targets = np.array([point], plan.targets.dtype)
    return {"plan": dataclasses.replace(plan, targets=targets, option=option)}


def edit_routing(scene):
    others = np.setdiff1d(np.arange(len(scene.plan.points)), scene.plan.targets)
    return {"plan": dataclasses.replace(scene.plan, points=moved(scene.plan.points, others, 2.0))}


def edit_map(scene):
    lanes = scene.town.lanes
    return {
        "town": dataclasses.replace(scene.town, lanes=lanes._replace(width_m=lanes.width_m + 1))
    }


def edit_obstacles(scene):
    scene.put(1, -20.0, -48.0, speed=3.0)
    return {}


def edit_traffic_lights(scene):
    scene.state.light[:] = scene.state.light % 3 + 1
    return {}


def edit_stop_signs(scene):
    signals = scene.town.signals
    signs = signals.kind[signals.stop_signal] == SignalKind.STOP
    poses = moved(signals.stop_pose, np.flatnonzero(signs), 1.0)
    return {"town": dataclasses.replace(scene.town, signals=signals._replace(stop_pose=poses))}


def edit_speed(scene):
    scene.state.speed[0] += 4.0
    scene.state.speed_history[0, scene.state.tick[()] % HISTORY_LENGTH] += 4.0
    return {}


def edit_speed_history(scene):
    now = scene.state.tick[()] % HISTORY_LENGTH
    past = np.arange(HISTORY_LENGTH) != now
    scene.state.speed_history[0, past] += 1.0
    return {}


EDITS = {name: globals()[f"edit_{name}"] for name in COMPONENTS}


@pytest.mark.parametrize("component", COMPONENTS)
def test_worlds_that_differ_in_one_component_differ_in_no_other(scene, component):
    scene.put(0, 0.0, -10.0, yaw=-PI / 2, speed=6.0)  # between the lights and the stop sign
    scene.put(1, 5.0, -30.0, speed=2.0)
    scene.state.light[:] = LightState.RED
    scene.state.tick[...] = 200
    scene.state.speed_history[0] = 6.0
    before = scene.observe()
    assert all(np.any(before[name]) for name in COMPONENTS), "a component is empty: nothing tested"
    after = scene.observe(**EDITS[component](scene))
    changed = {
        name for name in before if np.asarray(before[name]).tobytes() != after[name].tobytes()
    }
    assert changed == {component}


# ---- bounds

SPACE = observation_space(("prompt", "inertial"))
FAR = floats(-1e4, 1e4)


@settings(max_examples=50, deadline=None)
@given(
    x=FAR,
    y=FAR,
    z=floats(-4, 14),
    yaw=floats(-10, 10),
    speed=floats(0, 200),
    tick=integers(0, 10**6),
    near=booleans(),
)
def test_whatever_happens_the_observation_is_in_its_space(
    town, plan, x, y, z, yaw, speed, tick, near
):
    scene = Scene(town, plan)
    scene.put(0, x / 100 if near else x, y / 100 if near else y, z, yaw, speed)
    scene.put(1, x / 100, y / 100, z, -yaw, speed, ActorKind.WALKER)
    scene.state.tick[...] = tick
    scene.state.acceleration[0], scene.state.yaw_rate[0] = speed * 3, yaw
    seen = scene.observe(("prompt", "inertial"))
    assert seen.keys() == SPACE.spaces.keys()
    for name, space in SPACE.spaces.items():
        assert space.contains(seen[name]), f"{name}: {seen[name]}"
