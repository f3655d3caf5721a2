"""Traffic: its arithmetic by hand, and its manners in scenes that one can follow on paper."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from di_envs.numerics.geometry import boxes_overlap
from di_envs.suites import load_suite
from di_envs.town.lanes import LightState, SignalKind
from di_envs.town.loading import load_town
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.dynamics import locate_ego
from di_envs.world.lights import GREEN_TICKS
from di_envs.world.state import TICK_S, ActorKind, State, views_of
from di_envs.world.traffic.approach import can_stop
from di_envs.world.traffic.car_following import (
    ACCELERATION_MPS2,
    MAX_BRAKING_MPS2,
    NO_LEADER_M,
    idm_acceleration,
    safe_speed,
)
from di_envs.world.traffic.motion import place_vehicle
from di_envs.world.traffic.spawn import EGO_CLEARANCE_M, ROUTE_CLEARANCE_M, VEHICLES
from di_envs.world.traffic.speed_choice import LINE_GAP_M
from di_envs.world.world import World, WorldConfig
from tests.di_envs.world.toy_scene import (
    EAST_TO_1,
    EAST_TO_2,
    EAST_TO_2_RIGHT,
    FROM_EAST_RIGHT,
    FROM_EAST_STRAIGHT,
    FROM_WEST_LEFT,
    FROM_WEST_STRAIGHT,
    MIDDLE_LEFT,
    MIDDLE_RIGHT,
    MIDDLE_RIGHT_AT_1,
    MIDDLE_TO_1,
    MIDDLE_TO_2,
    NORTH_RIGHT,
    NORTH_STRAIGHT,
    NORTH_STRAIGHT_RIGHT,
    WEST_TO_1,
    WEST_TO_1_RIGHT,
    WEST_TO_2,
    ToyScene,
)

TOY = load_suite("toy")
STILL_MPS = 0.1


# arithmetic


def test_a_free_car_at_rest_accelerates_fully_and_at_its_desired_speed_not_at_all():
    assert idm_acceleration(0.0, 10.0, NO_LEADER_M, 0.0) == ACCELERATION_MPS2
    assert idm_acceleration(10.0, 10.0, NO_LEADER_M, 0.0) == 0.0
    # at half the speed: 3 (1 - 1/16)
    assert idm_acceleration(5.0, 10.0, NO_LEADER_M, 0.0) == pytest.approx(3.0 * 15.0 / 16.0)


def test_a_car_at_rest_five_metres_behind_another_stays():
    """highway-env wants 10 m between middles: 5 m between bumpers of its 5 m cars."""
    assert idm_acceleration(0.0, 10.0, 5.0, 0.0) == pytest.approx(0.0)
    assert idm_acceleration(0.0, 10.0, 4.9, 0.0) < 0.0 < idm_acceleration(0.0, 10.0, 5.1, 0.0)


def test_the_gap_wanted_behind_an_equally_fast_leader_is_ten_metres_and_one_and_a_half_seconds():
    """At 10 of 20 m/s: free part 1 - 1/16; 25 m wanted between middles, 50 m there: (1/2)^2."""
    expected = 3.0 * (15.0 / 16.0 - 0.25)
    assert idm_acceleration(10.0, 20.0, 45.0, 10.0) == pytest.approx(expected)


@given(speed=st.floats(0, 30), gap=st.floats(0, 200), leader=st.floats(0, 30))
def test_more_room_or_a_faster_leader_never_makes_a_driver_brake_harder(speed, gap, leader):
    here = idm_acceleration(speed, 15.0, gap, leader)
    assert idm_acceleration(speed, 15.0, gap + 5.0, leader) >= here
    assert idm_acceleration(speed, 15.0, gap, leader + 1.0) >= here or speed * (speed - leader) < 0


def test_the_safe_speed_behind_a_wall_is_what_one_can_brake_from():
    """12 m at 6 m/s2: v^2 / 12 + 0.05 v = 12, so v = 11.704 m/s."""
    speed = safe_speed(12.0, 0.0, 6.0, 6.0)
    assert speed * TICK_S + speed**2 / 12.0 == pytest.approx(12.0)
    assert speed == pytest.approx(-0.3 + math.sqrt(0.09 + 144.0))


@given(gap=st.floats(0, 100), leader=st.floats(0, 30))
def test_from_the_safe_speed_one_stops_behind_a_leader_who_brakes_from_now_on(gap, leader):
    speed, own, other = safe_speed(gap, leader, 6.0, 8.0), 0.0, gap
    while speed > 0.0 or leader > 0.0:
        other += leader * TICK_S
        own += speed * TICK_S
        leader = max(leader - 8.0 * TICK_S, 0.0)
        speed = max(speed - 6.0 * TICK_S, 0.0)
    # the leader moves in steps: at least the parabola's way
    assert own <= other + 1e-6


def test_no_room_means_standing_still():
    assert safe_speed(0.0, 0.0, 6.0, 6.0) == 0.0
    assert safe_speed(-3.0, 0.0, 6.0, 6.0) == 0.0


# following


def test_a_car_stops_behind_one_that_stands_and_never_touches_it():
    """In the middle street, which has one lane: there is no way round."""
    scene = ToyScene(vehicles=2)
    scene.put(0, [MIDDLE_TO_2], 64.0, speed=8.0)
    scene.put(1, [MIDDLE_TO_2], 20.0)
    gaps = []
    for state in scene.run(12.0):
        if state.tick % 4 == 0:
            with scene.edit() as held:  # broken down: it hardly moves
                held.speed[1], held.lane_m[1] = 0.0, 48.0
        state = scene.state
        gaps.append(state.lane_m[1] - state.lane_m[0] - 4.0)
    assert scene.state.speed[0] < STILL_MPS
    assert 0.4 <= min(gaps) <= gaps[-1] <= 6.0


@pytest.mark.parametrize(("offset_m", "stops"), [(0.0, True), (3.5, False)])
def test_a_car_reacts_to_an_ego_in_its_lane_and_to_none_on_the_opposite_lane(offset_m, stops):
    plan = TOY.plans(load_town("toy"), ["1"])[0]
    scene = ToyScene(vehicles=1, plans=(plan,))
    with scene.edit() as state:  # the middle street leads south: x falls to its right
        state.x[0], state.y[0], state.yaw[0] = -1.75 + offset_m, 10.0, math.pi / 2.0
        locate_ego(state, scene.town.lanes, 0)
    scene.put(1, [MIDDLE_TO_2], 64.0, speed=8.0)
    for state in scene.run(8.0):
        assert not _touch(state, 0, 1)
    assert bool(state.y[1] < 10.0) == stops
    assert bool(state.speed[1] < STILL_MPS) == stops


# lights and signs


def test_a_car_stops_before_a_red_line_and_goes_at_green():
    scene = ToyScene()
    scene.put(0, [WEST_TO_1, NORTH_STRAIGHT], 60.0, speed=12.0)
    scene.show("1", 1)  # another's turn: 15 s, the third's: 15 s, then ours
    gone = []
    for tick, state in enumerate(scene.run(36.0), 1):
        red = state.light[0] == LightState.RED
        if scene.to_end_m(0, WEST_TO_1) < 0.0:
            gone.append((tick, red))
        elif tick == 500:
            assert state.speed[0] < STILL_MPS
            assert 0.0 < scene.to_end_m(0, WEST_TO_1) < LINE_GAP_M + 0.5
    first, red = gone[0]
    assert not red
    assert 30.0 <= first * TICK_S <= 33.0


@pytest.mark.parametrize(("before_m", "stops"), [(35.0, True), (4.0, False)])
def test_at_yellow_one_stops_who_can_and_another_goes_on(before_m, stops):
    """From 12 m/s, braking at 4 m/s2 takes 18 m."""
    scene = ToyScene()
    scene.show("1", 0, ticks=190)  # 0.5 s of green left
    scene.put(0, [WEST_TO_1, NORTH_STRAIGHT], before_m + 6.0, speed=12.0)
    for _ in scene.run(8.0):
        pass
    assert (scene.to_end_m(0, WEST_TO_1) > 0.0) == stops


@given(speed=st.floats(1.0, 28.0), distance=st.floats(0.0, 150.0))
def test_who_goes_on_at_yellow_is_across_before_red_and_who_stops_can(speed, distance):
    """Up to 100 km/h there is no dilemma, even for who slows down for a bend behind the line."""
    if can_stop(speed, distance, 3.0):
        assert speed**2 / (2.0 * MAX_BRAKING_MPS2) < distance
        return
    gone = 0.0
    for _ in range(60):  # ticks of yellow
        gone += speed * TICK_S
        speed = max(speed - 2.0 * TICK_S, 1.0)
    assert gone > distance


def test_who_stands_a_hair_before_the_line_loses_the_grant_at_yellow():
    """Somebody on the crosswalk may have kept it there while it was green."""
    scene = ToyScene()
    scene.put(0, [WEST_TO_1, NORTH_STRAIGHT], 0.05)
    scene.show("1", 0, ticks=GREEN_TICKS)
    with scene.edit() as state:
        state.grant[0], state.grant_steps[0] = scene.lane(NORTH_STRAIGHT), 1
    for _ in scene.run(10.0):
        pass
    assert scene.to_end_m(0, WEST_TO_1) == pytest.approx(0.05)


def test_a_car_stops_at_the_stop_sign_and_then_goes():
    scene = ToyScene()
    scene.put(0, [MIDDLE_TO_2, MIDDLE_RIGHT], 40.0, speed=8.0)
    stopped = False
    for state in scene.run(20.0):
        before = scene.to_end_m(0, MIDDLE_TO_2)
        stopped |= state.speed[0] < STILL_MPS and 0.0 <= before < 4.0
        assert stopped or before >= 0.0
    assert before < 0.0


def test_a_minor_way_waits_for_a_car_on_the_major_road():
    """The middle street turns left across the way of one who comes from the west at 50 km/h."""
    scene = ToyScene(vehicles=2)
    scene.put(0, [MIDDLE_TO_2, MIDDLE_LEFT], 1.0)
    scene.put(1, [WEST_TO_2, FROM_WEST_STRAIGHT], 30.0, speed=12.0)
    ways = scene.lane(WEST_TO_2), scene.lane(FROM_WEST_STRAIGHT)
    slowest, order = math.inf, []
    for state in scene.run(12.0):
        if state.lane[1] in ways:
            slowest = min(slowest, state.speed[1])
        order += [actor for actor, name in ((0, MIDDLE_TO_2), (1, WEST_TO_2)) if actor not in order
                  and scene.to_end_m(actor, name) < 0.0]  # fmt: skip
    assert order == [1, 0]
    assert slowest > 8.0  # who has priority need not slow down


def test_a_left_turn_waits_for_oncoming_traffic():
    scene = ToyScene(vehicles=2)
    scene.put(0, [WEST_TO_2, FROM_WEST_LEFT], 3.0, speed=3.0)
    scene.put(1, [EAST_TO_2, FROM_EAST_STRAIGHT], 25.0, speed=12.0)
    order = []
    for _ in scene.run(10.0):
        order += [actor for actor, name in ((0, WEST_TO_2), (1, EAST_TO_2)) if actor not in order
                  and scene.to_end_m(actor, name) < 0.0]  # fmt: skip
    assert order == [1, 0]


@pytest.mark.parametrize("first", [0, 1])
def test_those_who_stop_at_signs_go_in_the_order_in_which_they_came(first):
    scene = ToyScene(vehicles=2, town="town05")
    ways = _ways_between_signs(scene.town)
    for actor in (0, 1):
        scene.put(actor, ways[actor], 0.5 if actor == first else 12.0)
    order = []
    for state in scene.run(30.0):
        order += [
            actor for actor in (0, 1) if actor not in order and state.lane[actor] == ways[actor][1]
        ]
        assert not _touch(state, 0, 1)
    assert order == [first, 1 - first]


def _ways_between_signs(town: Town) -> list[list[int]]:
    """Two approaches with stop signs, and a way on from each, such that the ways cross."""
    lanes, signals = town.lanes, town.signals
    signed = signals.kind[signals.stop_signal] == SignalKind.STOP
    approaches = signals.stop_lane[signed].tolist()
    ways = [
        (lane, int(lanes.successor[k]))
        for lane in approaches
        for k in range(lanes.successor_start[lane], lanes.successor_start[lane + 1])
    ]
    for a, way in ways:
        meets = lanes.conflict_lane[lanes.conflict_start[way] : lanes.conflict_start[way + 1]]
        for b, other in ways:
            if other in meets and a != b:
                return [[a, way], [b, other]]
    raise AssertionError("no two ways from signs cross")


# junctions


def test_a_junction_is_not_entered_when_its_exit_is_full():
    """A car that stands just behind the junction leaves no room for a second one."""
    scene = ToyScene(vehicles=2)
    exit_name = ("12", -1)
    scene.put(0, [WEST_TO_1, NORTH_STRAIGHT, exit_name], 20.0, speed=8.0)
    scene.put(1, [exit_name], scene.room(exit_name) - 7.0)  # its rear 3 m behind the junction
    scene.show("1", 0)
    for _ in scene.run(8.0):
        with scene.edit() as state:
            state.speed[1], state.lane_m[1] = 0.0, 5.0
    assert scene.to_end_m(0, WEST_TO_1) > 0.0
    for _ in scene.run(3.0):  # at green still: now it drives on, and so does the other
        pass
    assert scene.state.light[0] != LightState.RED
    for _ in scene.run(4.0):
        pass
    assert scene.state.lane_m[1] > 5.0


def test_who_has_long_stood_before_a_full_exit_takes_another_way():
    """From the right lane of the western street right, where somebody stands, or straight on."""
    scene = ToyScene(vehicles=2)
    right, straight = scene.lane(NORTH_RIGHT), scene.lane(NORTH_STRAIGHT_RIGHT)
    scene.put(0, [WEST_TO_1_RIGHT, NORTH_RIGHT], 3.0)
    scene.put(1, [MIDDLE_TO_2], 63.0)  # 3 m of room
    left_at = None
    for tick in range(1200):
        if tick % 10 == 0:
            with scene.edit() as state:
                state.speed[1], state.lane_m[1] = 0.0, 5.0
        if tick % 100 == 0:
            scene.show("1", 0)  # always green
        scene.world.advance(np.zeros((0, 3)))
        if left_at is None and scene.state.lane[0] == straight:
            left_at = tick * TICK_S
        assert scene.state.lane[0] != right
    assert left_at is not None
    assert left_at > 20.0


def test_two_ways_that_cross_are_never_driven_at_once():
    """Left from the middle street and straight on from the east, over many meetings."""
    for gap_m in range(5, 60, 5):
        scene = ToyScene(vehicles=2)
        scene.put(0, [MIDDLE_TO_2, MIDDLE_LEFT], 1.0)
        scene.put(1, [EAST_TO_2, FROM_EAST_STRAIGHT], float(gap_m), speed=10.0)
        for state in scene.run(12.0):
            assert not _touch(state, 0, 1)


def test_a_car_that_gets_its_next_grant_does_not_hide_others_who_hold_its_last_one():
    """Car 2 leaves junction 2 so fast that it is let into junction 1 in the same tick; car 1 still
    comes from the east by the same way, and car 0 would cross it."""
    scene = ToyScene(vehicles=3)
    scene.put(0, [WEST_TO_2, FROM_WEST_LEFT], 3.0)
    scene.put(1, [EAST_TO_2_RIGHT, FROM_EAST_RIGHT], 12.0, speed=5.0)
    scene.put(2, [MIDDLE_TO_1, MIDDLE_RIGHT_AT_1], scene.room(MIDDLE_TO_1) - 3.9, speed=14.0)
    scene.show("1", 2)
    shared = scene.lane(FROM_EAST_RIGHT)
    with scene.edit() as state:
        state.grant[1:3] = state.previous_lane[2] = shared
        state.grant_steps[1] = 1
    for _ in scene.run(0.2):
        pass
    assert scene.state.grant[2] == scene.lane(MIDDLE_RIGHT_AT_1)
    assert scene.state.grant.tolist()[:2] == [-1, shared]


def test_who_stands_in_a_junction_behind_somebody_holds_no_way_until_he_drives_on():
    """Both are on their way through from the west; after five seconds it is no reservation."""
    scene = ToyScene(vehicles=2)
    way = scene.lane(FROM_WEST_STRAIGHT)
    length = scene.room(FROM_WEST_STRAIGHT)
    scene.put(0, [FROM_WEST_STRAIGHT], length - 5.0)
    scene.put(1, [FROM_WEST_STRAIGHT], length - 12.0)
    with scene.edit() as state:
        state.grant[:2] = way
    held = []
    for _ in range(160):
        with scene.edit() as state:
            state.speed[1], state.lane_m[1] = 0.0, 10.0
        scene.world.advance(np.zeros((0, 3)))
        held.append(int(scene.state.grant[0]))
    assert held[60] == way
    assert held[-1] == -1
    for _ in scene.run(15.0):
        pass
    assert way not in scene.state.path[:2, 0]


# walkers


@pytest.mark.parametrize("somebody", [True, False])
def test_a_car_waits_at_green_while_a_walker_is_on_the_crosswalk(somebody):
    """The strip begins 0.75 m behind the stop line; 13 m of road at 1.3 m/s take 10 s."""
    scene = ToyScene(vehicles=1, walkers=1)
    strip = int(np.flatnonzero(scene.world._scenery.walk.crosswalk == 0)[0])
    scene.put(0, [WEST_TO_1, NORTH_STRAIGHT], 50.0, speed=12.0)
    scene.show("1", 0)
    if somebody:
        scene.put_walker(1, strip, 2.6)
    for state in scene.run(9.0):
        assert not (somebody and _touch(state, 0, 1))
    assert state.light[0] == LightState.GREEN
    assert (scene.to_end_m(0, WEST_TO_1) > -0.75) == somebody
    assert (state.speed[0] < STILL_MPS) == somebody
    if somebody:
        assert state.walk_edge[1] == strip
        scene.show("1", 0)  # once more green, and the walker gets across
        for state in scene.run(9.0):
            assert not _touch(state, 0, 1)
        assert scene.to_end_m(0, WEST_TO_1) < -0.75


# overtaking


@pytest.mark.parametrize("allowed", [True, False])
def test_a_slow_bicycle_is_overtaken_only_where_the_marks_allow_it(allowed):
    scene = ToyScene(vehicles=2)
    if not allowed:
        lanes = scene.town.lanes._replace(change=np.zeros_like(scene.town.lanes.change))
        scene.world.town = scene.town = replace(scene.town, lanes=lanes)
        scene.world.reset(0, ())
        with scene.edit() as state:
            state.kind[:2] = ActorKind.ABSENT
    way = [EAST_TO_1]
    scene.put(0, way, 230.0, speed=12.0)
    scene.put(1, way, 200.0, speed=5.0, kind=ActorKind.BICYCLE, factor=0.4)
    changed = ahead = False
    for state in scene.run(14.0):
        changed |= state.lane[0] == scene.lane(("12", 2))
        ahead |= state.lane_m[0] > state.lane_m[1] + 5.0
        assert not _touch(state, 0, 1)
    assert (changed, ahead) == (allowed, allowed)


# spawning


@pytest.fixture(scope="module")
def world() -> World:
    return World(load_town("town05"))


@pytest.fixture(scope="module")
def short_plans(world) -> tuple[RoutePlan, ...]:
    return load_suite("town05_short").plans(world.town)


@pytest.mark.parametrize("seed", range(20))
def test_nobody_starts_on_an_ego_or_its_path_or_on_another(seed, world, short_plans):
    plan = short_plans[seed]
    world.reset(seed, [plan])
    state = world.view.state
    vehicles = np.arange(1, 121)
    assert (state.kind[vehicles] != ActorKind.ABSENT).all()
    places = np.stack((state.x, state.y, state.z), axis=1)[vehicles]
    start = np.linalg.norm(places - plan.points[0, :3], axis=1)
    assert start.min() > EGO_CLEARANCE_M - 0.5
    for point in plan.points[plan.route_m <= ROUTE_CLEARANCE_M]:
        assert np.linalg.norm(places - point[:3], axis=1).min() > state.half_length[vehicles].max()
    near = np.linalg.norm(places[:, None] - places, axis=2) < 12.0
    pairs = np.argwhere(np.triu(near, 1)) + 1
    assert not any(_touch(state, a, b) for a, b in pairs)


def test_every_kind_of_vehicle_drives_about_as_often_as_it_should():
    """600 of them over five seeds; four standard deviations are allowed."""
    kinds = []
    world = World(load_town("town05"), WorldConfig(walkers=0))
    for seed in range(5):
        world.reset(seed, ())
        kinds += world.view.state.kind[:120].tolist()
    assert sum(model.share for model in VEHICLES) == pytest.approx(1.0)
    for model in VEHICLES:
        expected = 600.0 * model.share
        spread = math.sqrt(expected * (1.0 - model.share))
        assert abs(kinds.count(model.kind) - expected) < 4.0 * spread


def test_nobody_brakes_or_accelerates_beyond_what_cars_do():
    world = World(load_town("toy"), WorldConfig(vehicles=20, walkers=5))
    world.reset(0, ())
    state, controls = world.view.state, np.zeros((0, 3))
    for _ in range(2000):
        world.advance(controls)
        acceleration = state.acceleration[:20]
        assert acceleration.max() <= ACCELERATION_MPS2 + 1e-9
        assert acceleration.min() >= -8.0 - 1e-9
    assert MAX_BRAKING_MPS2 < 8.0  # which only an emergency takes


def _touch(state: State, a: int, b: int) -> bool:
    boxes = [
        (state.x[i], state.y[i], state.yaw[i], state.half_length[i], state.half_width[i])
        for i in (a, b)
    ]
    return bool(boxes_overlap(*boxes[0], *boxes[1])) and abs(state.z[a] - state.z[b]) < 3.0


def test_who_stands_is_where_he_would_be_placed_anew():
    """Those who stand are not placed each tick: nothing that their place depends on may change."""
    town, vehicles, stood = load_town("toy"), 20, 0
    world = World(town, WorldConfig(vehicles=vehicles, walkers=0))
    world.reset(3, ())
    for _ in range(40):
        world.advance(np.zeros((0, 3)), 50)
        anew = views_of(world.save().record)
        stands = (anew.kind != ActorKind.ABSENT) & (anew.speed == 0.0) & (anew.lateral_m == 0.0)
        for actor in np.flatnonzero(stands[:vehicles]):  # poles follow
            place_vehicle(anew, town.lanes, actor)
            stood += 1
        for name in ("x", "y", "z", "yaw"):
            assert np.array_equal(getattr(anew, name), getattr(world.view.state, name))
    assert stood > 100
