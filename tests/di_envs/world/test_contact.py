"""Contacts: nobody passes through, no energy is made, collisions count as in Leaderboard 1.0."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from di_envs.world.bodies import Box, overlap
from di_envs.world.contact import DOWN, INVERSE_MASS, SLOP_M, resolve_contacts
from di_envs.world.dynamics import EgoModel, move_ego
from di_envs.world.state import ActorKind, EventKind
from tests.di_envs.world.small_world import make_state, put, rows

LINCOLN = EgoModel().parameters()
HALF = LINCOLN.half_length_m


def meet(state, out=None):
    """One tick of contacts; returns the kinds of the collisions recorded."""
    out = rows() if out is None else out
    state.tick[()] += 1
    return [EventKind(int(kind)) for kind in out[: resolve_contacts(state, out, 0), 0]]


def depth(state):
    """How far the first two actors overlap."""
    fields = (state.x, state.y, state.z, state.yaw, state.half_length, state.half_width)
    first, second = (Box(*(float(field[k]) for field in fields)) for k in (0, 1))
    return overlap(first, second)[0]


def energy(state):
    movable = (state.kind != ActorKind.ABSENT) & (state.kind < ActorKind.PROP)
    kinds = state.kind[movable]
    return 0.5 * float(np.sum(state.speed[movable] ** 2 / INVERSE_MASS[kinds]))


def test_two_equal_cars_share_the_speed_of_a_rear_end_crash():
    state = make_state(vehicles=1)
    state.speed[0] = 10.0
    put(state, 1, ActorKind.CAR, 4.7, 0.0, speed=4.0)
    assert meet(state) == [EventKind.COLLISION_VEHICLE]
    assert list(state.speed) == [7.0, 7.0]
    assert state.x[0] == pytest.approx(4.7 - 2.4 - HALF - SLOP_M)


def test_a_prop_stops_the_ego_at_once_and_stays():
    state = make_state(props=1)
    state.speed[0] = 10.0
    put(state, 1, ActorKind.PROP, 2.7, 0.0, half_length=0.5, half_width=0.5)
    assert meet(state) == [EventKind.COLLISION_STATIC]
    assert list(state.speed) == [0.0, 0.0]
    assert state.x[1] == 2.7
    assert state.x[0] == pytest.approx(2.2 - HALF - SLOP_M)


def test_a_vending_machine_is_hit_and_debris_is_driven_over():
    state = make_state(props=1)
    state.speed[0] = 10.0
    put(state, 1, ActorKind.DEBRIS, 2.7, 0.0, half_length=0.5, half_width=0.5)
    assert meet(state) == []
    assert list(state.speed) == [10.0, 0.0]
    state.kind[1] = ActorKind.VENDING_MACHINE
    assert meet(state) == [EventKind.COLLISION_STATIC]
    assert list(state.speed) == [0.0, 0.0]


def test_full_throttle_does_not_get_an_ego_through_a_prop():
    state = make_state(props=1)
    put(state, 1, ActorKind.PROP, 10.0, 0.0, half_length=0.1, half_width=3.0)
    state.throttle[0] = 1.0
    for _ in range(200):
        state.tick[()] += 1
        move_ego(state, 0, LINCOLN)
        resolve_contacts(state, rows(), 0)
    assert state.x[0] + HALF <= 10.0 - 0.1
    assert state.x[0] + HALF > 9.5


def test_grazing_a_wall_costs_little_speed():
    state = make_state(props=1)
    state.speed[0], state.yaw[0] = 10.0, 0.1  # towards it by sin(0.1)
    put(state, 1, ActorKind.PROP, 0.0, 1.8, half_length=50.0, half_width=0.5)
    meet(state)
    assert state.speed[0] == pytest.approx(10.0 * (1.0 - math.sin(0.1) ** 2))


def test_an_oncoming_truck_stands_and_so_does_the_ego():
    state = make_state(vehicles=1)
    state.speed[0] = 10.0
    put(state, 1, ActorKind.TRUCK, 4.0, 0.0, yaw=math.pi, speed=0.0)
    meet(state)
    assert 0.0 <= state.speed[0] <= 10.0 * 1800 / (1800 + 8000)
    assert state.speed[1] == 0.0


def test_a_walker_falls_and_takes_a_share_of_momentum_once():
    state = make_state(walkers=1)
    state.speed[0] = 10.0
    put(state, 1, ActorKind.WALKER, 2.5, 0.0, speed=1.2, half_length=0.25, half_width=0.25)
    assert meet(state) == [EventKind.COLLISION_WALKER]
    assert state.walk_waiting[1] == DOWN
    assert state.speed[1] == 0.0
    assert state.speed[0] == pytest.approx(10.0 * 1800 / 1875)
    assert state.x[0] == 0.0  # it is the walker who is pushed away
    state.x[0] += 0.5
    meet(state)
    assert state.speed[0] == pytest.approx(10.0 * 1800 / 1875)
    assert state.x[1] - 0.25 >= state.x[0] + HALF


def test_bodies_on_a_bridge_do_not_touch_those_below():
    state = make_state(vehicles=1)
    put(state, 1, ActorKind.CAR, 1.0, 0.0, z=3.0)
    assert meet(state) == []
    state.z[1] = 2.9
    assert meet(state) == [EventKind.COLLISION_VEHICLE]


def test_being_hit_while_standing_counts():
    state = make_state(vehicles=1)
    put(state, 1, ActorKind.CAR, -4.7, 0.0, speed=6.0)
    assert meet(state) == [EventKind.COLLISION_VEHICLE]
    assert list(state.speed) == [3.0, 3.0]
    assert state.x[0] > 0.0


def test_two_egos_that_meet_both_count_it():
    state = make_state(egos=2)
    state.x[1] = 4.0
    state.speed[0] = 4.0
    assert meet(state) == [EventKind.COLLISION_VEHICLE] * 2
    assert list(state.counts[:, EventKind.COLLISION_VEHICLE]) == [1, 1]
    assert depth(state) == 0.0


def test_the_same_actor_counts_again_only_after_five_seconds_and_five_metres():
    state = make_state(vehicles=1)
    put(state, 1, ActorKind.CAR, 4.0, 0.0)
    assert len(meet(state)) == 1
    state.x[0], state.x[1] = 100.0, 104.0  # elsewhere, but the same actor within 5 s
    assert meet(state) == []
    state.tick[()] += 98  # exactly 5 s after the first
    assert meet(state) == []
    assert state.tick[()] - state.last_collision_tick[0] == 100
    state.x[0] = 100.0
    assert meet(state) == [EventKind.COLLISION_VEHICLE]


def test_another_actor_within_three_metres_of_the_last_place_does_not_count():
    state = make_state(vehicles=2)
    put(state, 1, ActorKind.CAR, 4.0, 0.0)
    put(state, 2, ActorKind.CAR, -4.0, 0.0)
    assert len(meet(state)) == 1  # both touch, one counts
    state.kind[1] = ActorKind.ABSENT
    place = state.collision_places[0, 0, 0]
    for moved, counts in ((2.9, 0), (3.1, 1)):
        state.x[0], state.y[0] = place + moved, 0.0
        put(state, 2, ActorKind.CAR, place + moved, 2.0)
        state.last_collision_actor[0] = -1
        assert len(meet(state)) == counts


def test_a_place_is_forgotten_once_the_ego_was_five_metres_away():
    state = make_state(vehicles=2)
    put(state, 1, ActorKind.CAR, 4.0, 0.0)
    meet(state)
    place = state.x[0]
    state.kind[1] = ActorKind.ABSENT
    state.x[0] = place + 5.1
    meet(state)
    assert np.isnan(state.collision_places[0]).all()
    state.x[0] = place
    put(state, 2, ActorKind.CAR, place + 4.0, 0.0)
    assert len(meet(state)) == 1


def test_nothing_counts_once_the_route_has_ended():
    state = make_state(vehicles=1)
    state.finished[0] = EventKind.TIMEOUT
    put(state, 1, ActorKind.CAR, 4.0, 0.0)
    assert meet(state) == []


def test_full_event_rows_are_refused():
    state = make_state(vehicles=1)
    put(state, 1, ActorKind.CAR, 4.0, 0.0)
    with pytest.raises(ValueError, match="event rows are full"):
        resolve_contacts(state, np.zeros((0, 8)), 0)


KINDS = [kind for kind in ActorKind if kind not in (ActorKind.ABSENT, ActorKind.DEBRIS)]


@settings(max_examples=200, deadline=None)
@given(
    kind=st.sampled_from(KINDS),
    x=st.floats(-6.0, 6.0),
    y=st.floats(-6.0, 6.0),
    yaw=st.floats(-math.pi, math.pi),
    ego_speed=st.floats(0.0, 30.0),
    speed=st.floats(0.0, 30.0),
)
def test_a_contact_makes_no_energy_and_leaves_no_overlap(kind, x, y, yaw, ego_speed, speed):
    state = make_state(vehicles=1)
    state.speed[0] = ego_speed
    put(state, 1, kind, x, y, yaw=yaw, speed=0.0 if kind >= ActorKind.PROP else speed)
    before = energy(state)
    meet(state)
    assert energy(state) <= before * (1.0 + 1e-12)
    assert (state.speed >= 0.0).all()
    assert np.isfinite((*state.x, *state.y)).all()
    assert depth(state) == 0.0
