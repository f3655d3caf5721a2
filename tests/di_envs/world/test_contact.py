"""Contacts: nobody passes through, no energy is made, collisions count as in Leaderboard 1.0."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from di_envs.world.bodies import Box, EgoNow, overlap
from di_envs.world.contact import INVERSE_MASS, SLOP_M, resolve_contacts
from di_envs.world.dynamics import EgoModel, move_ego
from di_envs.world.events.route_end import is_blocked
from di_envs.world.state import ActorKind, EventKind
from di_envs.world.struck import DOWN, lie, pass_shocks
from tests.di_envs.world.small_world import make_state, put, rows

LINCOLN = EgoModel().parameters()
HALF = LINCOLN.half_length_m


CARLAS = (EventKind.COLLISION_WALKER, EventKind.COLLISION_VEHICLE, EventKind.COLLISION_STATIC)
FIRSTS = (EventKind.FIRST_HIT_WALKER, EventKind.FIRST_HIT_VEHICLE, EventKind.FIRST_HIT_STATIC)


def meet(state, seen=CARLAS, ticks=1):
    """Some ticks of contacts; returns the kinds of collisions that one of the rules saw."""
    found = []
    for _ in range(ticks):
        out = rows()
        state.tick[()] += 1
        found += [EventKind(int(kind)) for kind in out[: resolve_contacts(state, out, 0), 0]]
    return [kind for kind in found if kind in seen]


def apart(state):
    """Lets the ego forget with whom it was in contact, as after a second without."""
    state.contact_tick[...] = 0


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


def walker_ahead(ego_speed=10.0):
    """A walker who crosses right before an ego."""
    state = make_state(walkers=1)
    state.speed[0] = ego_speed
    put(state, 1, ActorKind.WALKER, 2.5, 0.0, yaw=1.5, half_length=0.25, half_width=0.25)
    return state


def test_a_walker_falls_and_is_thrown_ahead_at_the_speed_that_the_ego_is_left_with():
    state = walker_ahead()
    assert meet(state) == [EventKind.COLLISION_WALKER]
    assert state.walk_waiting[1] == DOWN
    assert list(state.speed) == pytest.approx([10.0 * 1800 / 1875] * 2)
    assert state.yaw[1] == 0.0
    assert state.x[0] == 0.0  # it is the walker who is pushed away


def test_who_was_thrown_at_nine_metres_a_second_slides_for_seven_and_lies_ten_seconds():
    state = walker_ahead()
    meet(state)
    begin, ticks = state.x[1], 0
    while not lie(state, 1):
        ticks += 1
    assert ticks == 200
    assert state.x[1] - begin == pytest.approx(9.6**2 / (2.0 * 6.0), abs=0.01)  # 7.7 m
    assert state.speed[1] == 0.0


def test_who_lies_is_in_nobody_s_way_and_counts_no_more():
    state = walker_ahead()
    meet(state)
    state.speed[1] = 0.0
    for _ in range(200):
        state.x[0] += 0.48
        assert meet(state, CARLAS + FIRSTS) == []
    assert state.speed[0] == pytest.approx(9.6)
    assert state.x[0] == pytest.approx(96.0)


def test_a_rider_of_the_traffic_falls_slides_along_the_lane_and_is_gone():
    state = make_state(vehicles=1)
    state.speed[0] = 10.0
    put(state, 1, ActorKind.BICYCLE, 3.0, 0.0, half_length=0.9, half_width=0.3)
    state.lane[1] = state.grant[1] = 0
    assert meet(state) == [EventKind.COLLISION_VEHICLE]
    assert state.walk_waiting[1] == DOWN
    assert list(state.speed) == pytest.approx([10.0 * 1800 / 1900] * 2)
    pass_shocks(state, 1, 2)
    assert state.shock_ticks[1] == 200  # still sliding
    state.speed[1] = 0.0
    for _ in range(200):
        assert state.kind[1] == ActorKind.BICYCLE
        pass_shocks(state, 1, 2)
    assert state.kind[1] == ActorKind.ABSENT
    assert state.grant[1] == -1


def test_a_driver_who_was_hit_stands_five_seconds_after_coming_to_rest():
    state = make_state(vehicles=1)
    state.speed[0] = 10.0
    put(state, 1, ActorKind.CAR, 4.7, 0.0)
    meet(state)
    assert state.speed[1] == 5.0
    pass_shocks(state, 1, 2)
    assert state.shock_ticks[1] == 100
    state.speed[1] = 0.0
    for _ in range(100):
        assert state.shock_ticks[1] > 0
        pass_shocks(state, 1, 2)
    assert (state.shock_ticks[1], state.kind[1]) == (0, ActorKind.CAR)


def lean(state, throttle, seconds):
    """An ego pushes on for so long against who stands on the brakes.

    Returns:
        Its speeds as the rules see them, and whether they called it blocked.
    """
    state.throttle[0] = throttle
    speeds, blocked = [], False
    for _ in range(round(seconds / 0.05)):
        state.tick[()] += 1
        state.speed[1] = max(state.speed[1] - 8.0 * 0.05, 0.0)
        state.x[1] += state.speed[1] * 0.05
        move_ego(state, 0, LINCOLN)
        resolve_contacts(state, rows(), 0)
        speeds.append(float(state.speed[0]))
        now = EgoNow(0, int(state.tick[()]), 0.0, 0.0, 0.0, 0.0, speeds[-1], HALF, -1, 0.0)
        blocked = blocked or is_blocked(state, now)
    return speeds, blocked


@pytest.mark.parametrize("kind", [ActorKind.CAR, ActorKind.TRUCK, ActorKind.BUS])
@pytest.mark.parametrize("throttle", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("aside", [0.0, 1.8])
def test_an_ego_that_leans_on_a_standing_vehicle_stands(kind, throttle, aside):
    state = make_state(vehicles=1)
    put(state, 1, kind, 5.0, aside)
    lean(state, throttle, 5.0)
    there = state.x[1]
    assert there < 7.0
    speeds, _ = lean(state, throttle, 15.0)
    assert max(speeds) < 0.1
    assert state.x[1] == there
    assert state.counts[0, EventKind.COLLISION_VEHICLE] == 1


def test_leaning_for_three_minutes_is_being_blocked():
    state = make_state(vehicles=1)
    put(state, 1, ActorKind.CAR, 5.0, 0.0)
    assert not lean(state, 0.6, 179.0)[1]
    assert lean(state, 0.6, 3.0)[1]


def test_a_push_that_locked_wheels_hold_moves_nothing_and_a_harder_one_does():
    # the car would gain half the speed; its wheels hold 8 m/s2 * 0.05 s = 0.4 m/s
    for speed, after in ((0.79, [0.0, 0.0]), (0.81, [0.405, 0.405])):
        state = make_state(vehicles=1)
        state.speed[0] = speed
        put(state, 1, ActorKind.CAR, 4.7, 0.0)
        meet(state)
        assert list(state.speed) == pytest.approx(after)


def test_bodies_pushed_on_for_ten_seconds_count_once_each_however_far():
    state = make_state(vehicles=2)
    put(state, 1, ActorKind.CAR, 4.8, 1.5)
    put(state, 2, ActorKind.CAR, 4.8, -1.5)
    found = []
    for _ in range(20):  # every half second another one of them touches
        for pushed, other in ((1, 2), (2, 1)):
            state.x[pushed], state.x[other] = state.x[0] + 4.8, state.x[0] + 20.0
            found += meet(state, CARLAS + FIRSTS)
            state.tick[()] += 9
            state.x[0] += 2.0
    assert sorted(found) == [EventKind.COLLISION_VEHICLE] * 2 + [EventKind.FIRST_HIT_VEHICLE] * 2


def test_the_first_hit_counts_where_carla_overlooks_it_and_only_then():
    state = make_state(vehicles=2)
    put(state, 1, ActorKind.CAR, 4.0, 0.0)
    put(state, 2, ActorKind.CAR, -4.0, 0.0)
    assert meet(state, FIRSTS) == [EventKind.FIRST_HIT_VEHICLE] * 2
    assert state.counts[0, EventKind.COLLISION_VEHICLE] == 1
    state.kind[2] = ActorKind.ABSENT
    state.tick[()] += 200
    state.x[0], state.x[1] = 100.0, 104.0  # elsewhere, ten seconds later
    assert meet(state, CARLAS + FIRSTS) == [EventKind.COLLISION_VEHICLE]


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
    apart(state)
    state.tick[()] += 98  # exactly 5 s after the first
    assert meet(state) == []
    assert state.tick[()] - state.last_collision_tick[0] == 100
    apart(state)
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
        apart(state)
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
    assert depth(state) == 0.0 or state.walk_waiting[1] == DOWN  # who lies is in nobody's way
