"""Walkers overlook no vehicle: those near by cell and by lane are those near of all there are."""

import math

import numpy as np
import pytest

from di_envs.town.loading import load_town
from di_envs.world.walkers.crossing import (
    is_blocked,
    is_coming,
    is_in_the_way,
    is_on_strip,
    may_cross,
)
from di_envs.world.walkers.neighbours import (
    LOOK_S,
    fill_neighbours,
    is_vehicle,
    make_neighbours,
)
from di_envs.world.walkers.walk_graph import build_walk_graph
from di_envs.world.world import World, WorldConfig


@pytest.fixture(scope="module")
def busy_town():
    """Town05 with traffic at speed, without lights at crosswalks: nobody is held by them."""
    town = load_town("town05")
    world = World(town, WorldConfig(vehicles=200, walkers=60))
    world.reset(1, [])
    world.advance(np.zeros((0, 3)), 1200)
    walk = build_walk_graph(town)
    walk = walk._replace(light_start=np.zeros_like(walk.light_start))
    near = make_neighbours(world.view.state.kind.size, town.lanes.kind.size)
    fill_neighbours(near, world.view.state, 200, 260)
    return town, walk, world.view.state, near


def test_who_is_near_by_cell_and_lane_is_who_is_near_of_all(busy_town):
    """Nobody is overlooked: crosswalks by each vehicle, in turn, of the world."""
    town, walk, state, near = busy_town
    held = []
    for crosswalk in range(len(walk.strip)):
        looked_at = [
            is_coming(state, walk, crosswalk, vehicle)
            or is_on_strip(state, walk.strip[crosswalk], vehicle)
            for vehicle in range(200)
        ]
        held.append(any(looked_at))
        assert may_cross(state, walk, town.signals, near, crosswalk, 100) != held[-1]
    assert 5 <= sum(held) <= len(held) - 5


def test_a_step_is_held_by_whom_it_would_be_held_by_of_all(busy_town):
    _town, _walk, state, near = busy_town
    rng, found = np.random.default_rng(0), 0
    for vehicle in rng.integers(0, 200, 500):
        ahead = state.half_length[vehicle] + LOOK_S * state.speed[vehicle]
        along, beside = rng.uniform(-6.0, ahead + 2.5), rng.uniform(-4.0, 4.0)
        cos, sin = math.cos(state.yaw[vehicle]), math.sin(state.yaw[vehicle])
        x = state.x[vehicle] + along * cos - beside * sin
        y = state.y[vehicle] + along * sin + beside * cos
        step = (x, y, state.z[vehicle], rng.uniform(-math.pi, math.pi), 0.175, 0.3)
        expected = any(
            is_in_the_way(state, other, *step, LOOK_S)
            for other in range(200)
            if is_vehicle(state.kind[other])
        )
        assert is_blocked(state, near, True, *step) == expected
        assert not is_blocked(state, near, False, *step)  # there is no ego
        found += expected
    assert 50 <= found <= 450
