"""What an ego touches, what is ahead of it, whether it lies over a line: states made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from di_envs.sensors.proximity import across_line_of, contacts_of, obstacle_of
from di_envs.town.loading import load_town
from di_envs.world.kinds import ActorKind
from di_envs.world.state import Capacity, state_dtype, views_of

SIZES = {"half_length": 2.0, "half_width": 1.0}


def state_of(others=(), tick=9, **ego):
    """An ego at the origin that faces east, and cars at places ahead and to its right."""
    state = views_of(np.zeros(1, state_dtype(Capacity(1, len(others), 0, 0, 0, 0))))
    state.tick[...] = tick
    state.kind[:] = ActorKind.CAR
    state.half_length[:], state.half_width[:] = SIZES["half_length"], SIZES["half_width"]
    for field, value in ego.items():
        getattr(state, field)[0] = value
    for actor, (x, y) in enumerate(others, start=1):
        state.x[actor], state.y[actor] = x, y
    return state


def test_bodies_touched_in_this_tick_are_listed_where_they_are():
    state = state_of([(3.0, 4.0), (5.0, 0.0)], yaw=math.pi / 2.0)  # it faces south
    state.contact_tick[0, 1] = 9
    state.contact_tick[0, 2] = 8  # that was before
    rows = contacts_of(state, 0)
    np.testing.assert_allclose(rows[0], [2.0, ActorKind.CAR, 4.0, -3.0], atol=1e-6)
    assert not rows[1:].any()
    assert not contacts_of(state_of([(3.0, 4.0)], tick=0), 0).any()  # nothing has happened yet


def test_the_nearest_body_in_a_strip_a_metre_wide_is_the_obstacle():
    """Half a metre to each side: a car 1.4 m to the side reaches into it, one at 1.6 m does not."""
    state = state_of([(20.0, 1.4), (10.0, 1.6), (-5.0, 0.0), (70.0, 0.0)])
    np.testing.assert_allclose(obstacle_of(state, 0), [2.0, ActorKind.CAR, 18.0])
    assert not obstacle_of(state_of(), 0).any()
    state.kind[1] = ActorKind.ABSENT
    assert not obstacle_of(state, 0).any()


@pytest.mark.parametrize(("over_m", "across"), [(-0.05, 0), (0.05, 1)])
def test_a_car_lies_over_its_lanes_edge_when_a_side_is_beyond_it(over_m, across):
    lanes = load_town("toy").lanes
    lane = int(np.flatnonzero((lanes.kind == 1) & (lanes.junction < 0))[0])
    first = int(lanes.first[lane])
    edge_m = 0.5 * float(lanes.width_m[first])
    fields = {"lane": lane, "yaw": float(lanes.points[first, 3])}
    aside = state_of(lateral_m=edge_m - SIZES["half_width"] + over_m, **fields)
    assert across_line_of(aside, lanes, 0).tolist() == [across]
    assert across_line_of(state_of(lane=-1), lanes, 0).tolist() == [0]
