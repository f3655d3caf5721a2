"""How walkers keep apart: they pass each other, step aside, or turn back."""

import math

import numpy as np
import pytest

from di_envs.world.struck import strike
from di_envs.world.walkers.on_edges import place_on_edge
from di_envs.world.walkers.personal_space import CLEAR_M
from di_envs.world.walkers.spawn import spawn_walkers
from di_envs.world.walkers.walk_graph import build_walk_graph
from tests.di_envs.world.crossings import OPEN, Crossing, walk_on
from tests.di_envs.world.small_world import make_state


def test_walkers_keep_to_the_right_so_that_they_can_pass_each_other():
    crossing = Crossing()
    state = crossing.state
    for direction, side in ((1, 0.5), (-1, -0.5)):  # heading east, the right is south
        crossing.go(crossing.sidewalk, 40.0, direction)
        crossing.tick(40)
        assert state.y[2] - 10.0 == pytest.approx(side)


def test_a_fast_walker_does_not_walk_into_a_slow_one():
    walk = build_walk_graph(OPEN)
    state = make_state(walkers=2)
    spawn_walkers(state, walk, 1, 2)
    edge = int(np.flatnonzero(walk.length_m == 80.0)[0])
    state.desired_factor[1:] = 0.8, 1.8
    for walker, station in ((1, 10.0), (2, 5.0)):
        state.walk_edge[walker], state.walk_m[walker] = edge, station
        state.walk_direction[walker] = 1
        place = place_on_edge(walk, edge, station, 1)
        state.x[walker], state.y[walker], state.z[walker], state.yaw[walker] = place
    for _ in range(1000):
        state.tick[()] += 1
        walk_on(state, walk, 1, state.kind.size)
        assert state.walk_m[1] - state.walk_m[2] > CLEAR_M
    assert state.walk_m[1] == pytest.approx(50.0)
    assert state.walk_m[2] > 47.0


def test_two_who_meet_where_there_is_no_room_to_pass_stop_and_turn_back():
    walk = build_walk_graph(OPEN)
    no_room = dict.fromkeys(("forth_m", "back_m", "left_m", "right_m"), np.zeros(walk.size.size))
    walk = walk._replace(**no_room)
    state = make_state(walkers=2)
    spawn_walkers(state, walk, 1, 2)
    edge = int(np.flatnonzero(walk.length_m == 80.0)[0])
    state.desired_factor[1:] = 1.0
    for walker, station, direction in ((1, 10.0, 1), (2, 20.0, -1)):
        state.walk_edge[walker], state.walk_m[walker] = edge, station
        state.walk_direction[walker] = direction
        place = place_on_edge(walk, edge, station, direction)
        state.x[walker], state.y[walker], state.z[walker], state.yaw[walker] = place
    gaps = []
    for _ in range(300):
        state.tick[()] += 1
        walk_on(state, walk, 1, state.kind.size)
        gaps.append(abs(state.x[1] - state.x[2]))
    assert CLEAR_M <= min(gaps) < CLEAR_M + 0.1
    assert list(state.walk_direction[1:]) != [1, -1]
    assert state.speed[1:].min() > 0.9


def two_who_meet(walk, stations=(10.0, 20.0), directions=(1, -1), lateral=0.0):
    """Two walkers (actors 1 and 2) on the line of one sidewalk, `lateral` metres to its right."""
    walk = walk._replace(
        forth_m=np.full(walk.size.size, lateral), back_m=np.full(walk.size.size, lateral)
    )
    state = make_state(walkers=2)
    spawn_walkers(state, walk, 1, 2)
    edge = int(np.flatnonzero(walk.length_m == 80.0)[0])
    state.desired_factor[1:] = 1.0
    for walker, station, direction in zip((1, 2), stations, directions, strict=True):
        state.walk_edge[walker], state.walk_m[walker] = edge, station
        state.walk_direction[walker] = direction
        place = place_on_edge(walk, edge, station, direction)
        state.x[walker], state.y[walker], state.z[walker], state.yaw[walker] = place
    return state, walk


def test_two_who_meet_on_one_line_step_to_their_right_and_pass():
    state, walk = two_who_meet(build_walk_graph(OPEN))
    aside = np.zeros(2)
    for _ in range(300):
        state.tick[()] += 1
        walk_on(state, walk, 1, 3)
        assert math.hypot(state.x[1] - state.x[2], state.y[1] - state.y[2]) >= CLEAR_M - 1e-9
        right = (state.y[1:] - 10.0) * state.walk_direction[1:]  # heading east it is south
        aside = np.maximum(aside, right)
        assert right.min() > -0.2
    assert list(state.walk_direction[1:]) == [1, -1]
    assert state.walk_m[1] > 23.0
    assert state.walk_m[2] < 7.0
    assert aside.max() < 0.8


def test_where_the_right_is_the_road_one_steps_to_the_left():
    walk = build_walk_graph(OPEN)
    walk = walk._replace(right_m=np.zeros(walk.size.size))  # south of the line is no room
    state, walk = two_who_meet(walk)
    for _ in range(300):
        state.tick[()] += 1
        walk_on(state, walk, 1, 3)
        assert (state.y[1:] - 10.0).max() < 0.05
    assert state.walk_m[1] > 22.0
    assert state.walk_m[2] < 8.0


def test_one_who_stands_in_the_way_is_gone_round():
    state, walk = two_who_meet(build_walk_graph(OPEN))
    strike(state, 2)
    for _ in range(180):
        state.tick[()] += 1
        walk_on(state, walk, 1, 3)
    assert state.x[1] > 18.0
    assert list(state.walk_direction[1:]) == [1, -1]
