"""Walkers: who walks, when they cross, and whom they wait for."""

import numpy as np
import pytest

from di_envs.numerics.geometry import boxes_overlap
from di_envs.town.lanes import LightState
from di_envs.town.loading import load_town
from di_envs.world.state import TICK_S, ActorKind
from di_envs.world.struck import strike
from di_envs.world.walkers.crossing import could_stop, ticks_to_green
from di_envs.world.walkers.lane_clearance import clearances
from di_envs.world.walkers.personal_space import CLEAR_M
from di_envs.world.walkers.spawn import spawn_walkers
from di_envs.world.walkers.walk_graph import build_walk_graph
from di_envs.world.world import World, WorldConfig
from tests.di_envs.world.crossings import KERB, OPEN, WITH_LIGHT, Crossing, walk_on
from tests.di_envs.world.small_world import (
    EAST,
    EAST_RIGHT,
    LANES,
    ONCOMING,
    make_lanes,
    make_signals,
    make_state,
    make_town,
    put,
)


def test_a_town_without_sidewalks_has_no_walkers():
    walk = build_walk_graph(make_town(make_lanes(LANES[:2])))
    state = make_state(walkers=3)
    spawn_walkers(state, walk, 1, 3)
    assert list(state.kind[1:]) == [ActorKind.ABSENT] * 3
    walk_on(state, walk, 1, state.kind.size)


# strolling


def test_a_walker_s_start_depends_on_nobody_else():
    walk = build_walk_graph(OPEN)
    few, many = make_state(walkers=5), make_state(walkers=40)
    for state, count in ((few, 5), (many, 40)):
        state.seed[...] = 7
        spawn_walkers(state, walk, 1, count)
    assert np.array_equal(few.x[1:6], many.x[1:6])
    assert np.array_equal(few.desired_factor[1:6], many.desired_factor[1:6])
    many.seed[...] = 8
    spawn_walkers(many, walk, 1, 40)
    assert not np.array_equal(few.x[1:6], many.x[1:6])


def test_nobody_starts_on_somebody_else_and_paces_differ():
    walk = build_walk_graph(OPEN)
    state = make_state(walkers=30)
    spawn_walkers(state, walk, 1, 30)
    present = np.flatnonzero(state.kind == ActorKind.WALKER)
    assert len(present) >= 25  # on 200 m of sidewalk some find no place
    for edge in np.unique(state.walk_edge[present]):
        stations = np.sort(state.walk_m[present][state.walk_edge[present] == edge])
        assert (np.diff(stations) >= 1.5).all()
    pace = state.desired_factor[present]
    assert 0.8 <= pace.min() < 1.0
    assert 1.6 < pace.max() <= 1.8


def test_ten_seconds_at_a_metre_and_a_half_a_second_cover_fifteen_metres():
    crossing = Crossing()
    state = crossing.state
    crossing.go(crossing.sidewalk, 10.0)
    crossing.tick(200)
    assert state.walk_m[2] == pytest.approx(25.0)
    assert (state.x[2], state.speed[2]) == (pytest.approx(25.0), pytest.approx(1.5))


def test_walkers_turn_round_where_a_sidewalk_ends():
    crossing = Crossing()
    state = crossing.state
    crossing.go(crossing.sidewalk, 0.05, -1)
    crossing.tick(1)
    assert (state.walk_edge[2], state.walk_direction[2]) == (crossing.sidewalk, 1)
    assert state.walk_m[2] == 0.0


def test_a_walker_stops_before_an_ego_that_stands_on_the_sidewalk():
    crossing = Crossing()
    state = crossing.state
    crossing.go(crossing.sidewalk, 10.0)
    crossing.tick(20)
    put(state, 0, ActorKind.CAR, 20.0, state.y[2])
    crossing.tick(150)
    assert state.speed[2] == 0.0
    assert 20.0 - 2.4 - 0.25 - 0.6 < state.x[2] < 20.0 - 2.4 - 0.25


# crossing


def test_a_free_crosswalk_is_crossed_at_once_and_is_busy_meanwhile():
    crossing = Crossing()
    crossing.tick(8)
    assert not crossing.waits
    busy = 0
    for _ in range(300):
        crossing.tick()
        busy += int(crossing.busy[0])
    assert crossing.walk.crosswalk[crossing.state.walk_edge[2]] == -1
    # 10.5 m of road, 1.25 m before and 0.25 m behind it, at 1.5 m/s
    assert busy * TICK_S == pytest.approx(12.0 / 1.5, abs=0.5)


@pytest.mark.parametrize(("lane", "begin"), [(EAST, 78.5), (EAST_RIGHT, 78.5), (ONCOMING, 18.5)])
def test_walkers_wait_for_a_car_that_could_not_stop_comfortably(lane, begin):
    # at 6 m/s: 36 / 5 + 0.7 * 6 + 3 = 14.4 m
    for gap, waits in ((14.3, True), (14.5, False)):
        crossing = Crossing()
        crossing.car(begin - gap, lane, speed=6.0)
        crossing.tick(8)
        assert crossing.waits == waits


def test_comfortable_stopping_distance_is_that_of_the_formula():
    assert could_stop(10.0, 30.0)  # 100 / 5 + 7 + 3
    assert not could_stop(10.0, 29.9)
    assert could_stop(0.0, 0.0)  # who stands, stands


def test_a_car_that_goes_elsewhere_or_has_passed_is_no_reason_to_wait():
    crossing = Crossing()
    crossing.car(70.0)
    crossing.state.path[1, 0] = ONCOMING
    crossing.tick(8)
    assert not crossing.waits
    crossing = Crossing()
    crossing.car(81.5 + 4.8 + 0.1)
    crossing.tick(8)
    assert not crossing.waits


def test_an_ego_s_way_is_unknown_so_walkers_wait_for_it():
    crossing = Crossing()
    crossing.car(70.0, actor=0)
    crossing.state.path[0, 0] = -1
    crossing.tick(8)
    assert crossing.waits


def test_nobody_steps_onto_a_strip_that_a_car_stands_on():
    crossing = Crossing()
    crossing.car(79.0, speed=0.0)
    crossing.tick(200)
    assert crossing.waits
    assert not crossing.busy[0]
    crossing.car(78.4, speed=0.0)  # it stands before the strip
    crossing.tick(8)
    assert not crossing.waits


def test_a_car_on_the_bridge_above_is_no_reason_to_wait():
    crossing = Crossing()
    crossing.car(80.0, speed=0.0)
    crossing.state.z[1], crossing.state.lane[1] = 10.0, -1
    crossing.tick(8)
    assert not crossing.waits


@pytest.mark.parametrize(
    ("light", "phase_ticks", "waits"),
    [
        (LightState.GREEN, 0, True),
        (LightState.YELLOW, 0, True),
        (LightState.RED, 0, False),  # 300 ticks until the other group's turn is over
        (LightState.RED, 150, True),  # 7.5 s left: 11.75 m at 1.5 m/s take 7.8 s, and one is spare
    ],
)
def test_walkers_cross_only_while_the_light_stays_red_long_enough(light, phase_ticks, waits):
    crossing = Crossing(WITH_LIGHT)
    crossing.state.light[0] = light
    crossing.state.phase_group[0], crossing.state.phase_ticks[0] = 1, phase_ticks
    crossing.tick(8)
    assert crossing.waits == waits


def test_the_time_to_green_counts_the_turns_of_the_others():
    signals = make_signals()  # group 0 of two, turns of 15 s
    assert ticks_to_green(signals, 0, 1, 100) == 200
    assert ticks_to_green(signals, 0, 0, 270) == 330  # its own turn ends first


def test_a_car_that_drives_on_regardless_makes_a_walker_pause():
    crossing = Crossing()
    crossing.tick(40)
    assert crossing.state.walk_m[2] > KERB
    crossing.car(80.0, EAST, speed=0.0)
    crossing.tick(60)
    state = crossing.state
    assert state.speed[2] == 0.0
    assert state.y[2] - 0.25 > 1.0  # the car's side
    assert crossing.busy[0]
    state.kind[1] = ActorKind.ABSENT
    crossing.tick(10)
    assert state.speed[2] > 0.0


def test_who_waits_for_forty_seconds_turns_back():
    crossing = Crossing()
    crossing.car(79.0, speed=0.0)
    crossing.tick(800)
    assert crossing.waits
    crossing.tick(5)
    assert crossing.state.walk_direction[2] == -1
    assert not crossing.busy[0]
    crossing.tick(100)
    assert crossing.walk.crosswalk[crossing.state.walk_edge[2]] == -1


def test_who_was_knocked_down_lies_for_ten_seconds():
    crossing = Crossing()
    crossing.tick(40)
    strike(crossing.state, 2)
    crossing.tick(200)
    assert crossing.state.kind[2] == ActorKind.WALKER
    assert crossing.busy[0]
    crossing.tick()
    assert crossing.state.kind[2] == ActorKind.ABSENT
    assert not crossing.busy[0]


# towns


def hits(state, vehicles, walkers):
    """Pairs of a vehicle and a walker whose boxes overlap."""
    near = np.abs(state.x[vehicles, None] - state.x[None, walkers]) < 8.0
    near &= np.abs(state.y[vehicles, None] - state.y[None, walkers]) < 8.0
    near &= np.abs(state.z[vehicles, None] - state.z[None, walkers]) < 3.0
    near &= state.kind[None, walkers] == ActorKind.WALKER
    found = []
    for v, w in np.argwhere(near):
        boxes = [
            (state.x[a], state.y[a], state.yaw[a], state.half_length[a], state.half_width[a])
            for a in (vehicles.start + v, walkers.start + w)
        ]
        if boxes_overlap(*boxes[0], *boxes[1]):
            found.append((int(v), int(w)))
    return found


@pytest.mark.parametrize(("name", "vehicles"), [("toy", 20), ("town05", 120)])
def test_traffic_never_touches_a_walker_and_walkers_do_cross(name, vehicles):
    town = load_town(name)
    world = World(town, WorldConfig(vehicles=vehicles, walkers=60))
    world.reset(3, [])
    state, walk = world.view.state, build_walk_graph(town)
    walkers = slice(vehicles, vehicles + 60)
    crossed = 0
    for _ in range(480):
        before = walk.crosswalk[state.walk_edge[walkers]] >= 0
        world.advance(np.zeros((0, 3)), 5)
        assert hits(state, slice(0, vehicles), walkers) == []
        after = walk.crosswalk[state.walk_edge[walkers]] >= 0
        crossed += np.count_nonzero(before & ~after)
        strolling = np.column_stack((state.x, state.y, state.z))[walkers][~after]
        assert clearances(town.lanes, strolling).min() >= 0.25 + 0.4 - 1e-6
    assert crossed >= 10


@pytest.mark.parametrize(("walkers", "seed"), [(60, 0), (120, 1)])
def test_nobody_is_stuck_for_two_minutes(walkers, seed):
    """Ten minutes of the shipped town; who stays within three metres gets nowhere."""
    world = World(load_town("town05"), WorldConfig(vehicles=120, walkers=walkers))
    world.reset(seed, [])
    state, slots = world.view.state, slice(120, 120 + walkers)
    anchor, since = np.column_stack((state.x, state.y))[slots], np.zeros(walkers)
    for second in range(600):
        world.advance(np.zeros((0, 3)), 20)
        here = np.column_stack((state.x, state.y))[slots]
        gone = np.hypot(*(here - anchor).T) > 3.0
        anchor[gone], since[gone] = here[gone], second
        assert second - since.min() <= 120.0
        apart = np.hypot(*(here[:, None] - here[None]).T) + 9.0 * np.eye(walkers)
        level = np.abs(state.z[slots, None] - state.z[None, slots]) < 3.0
        assert apart[level].min() >= CLEAR_M - 1e-9
    assert (state.kind[slots] == ActorKind.WALKER).all()


def test_walkers_stroll_on_the_real_town05_which_has_no_crosswalks(shared):
    town = load_town(shared / "data" / "xodr" / "Town05.xodr", signals="none")
    walk = build_walk_graph(town)
    assert (walk.crosswalk == -1).all()
    assert walk.length_m.sum() > 8000.0  # of 8.7 km of sidewalk
    state = make_state(walkers=60)
    state.seed[...] = 1
    spawn_walkers(state, walk, 1, 60)
    for _ in range(1200):
        state.tick[()] += 1
        walk_on(state, walk, 1, 61, town.signals)
    places = np.column_stack((state.x, state.y, state.z))[1:]
    assert clearances(town.lanes, places).min() >= 0.25 + 0.4 - 1e-6
    assert (state.kind[1:] == ActorKind.WALKER).all()
