"""Traffic's driver model against highway-env's own `IDMVehicle`: the oracle nobody here wrote."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from di_envs.town.town import Town
from di_envs.world.state import ActorKind, Capacity, state_dtype, views_of
from di_envs.world.traffic.car_following import (
    ACCELERATION_MPS2,
    CAR_LENGTH_M,
    COMFORT_BRAKING_MPS2,
    DISTANCE_WANTED_M,
    MAX_BRAKING_MPS2,
    NO_LEADER_M,
    TIME_WANTED_S,
    idm_acceleration,
)
from di_envs.world.traffic.lane_change import MAX_BRAKING_IMPOSED_MPS2, MIN_GAIN_MPS2, _mobil
from di_envs.world.traffic.motion import place_vehicle
from di_envs.world.traffic.occupancy import fill_occupancy, make_occupancy
from di_envs.world.traffic.speed_choice import allowed_speed
from di_envs.world.traffic.tables import traffic_tables
from tests.di_envs.world.small_world import LaneSpec, make_lanes, make_town

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of its dependencies
    from highway_env.road.lane import StraightLane
    from highway_env.road.road import Road, RoadNetwork
    from highway_env.vehicle.behavior import IDMVehicle
    from highway_env.vehicle.kinematics import Vehicle

LIMIT_MPS = 30.0
speeds = st.floats(0.0, 25.0)


def make_road() -> Road:
    """Two straight lanes of highway-env, 1 km long."""
    network = RoadNetwork()
    for lane in range(2):
        y = 4.0 * lane
        network.add_lane("0", "1", StraightLane([0, y], [1000, y], speed_limit=LIMIT_MPS))
    return Road(network, np_random=np.random.RandomState(0))


def make_vehicle(road: Road, x: float, speed: float, desired: float, lane: int = 0) -> IDMVehicle:
    """A driver of highway-env, on the road."""
    vehicle = IDMVehicle(
        road,
        [x, 4.0 * lane],
        speed=speed,
        target_speed=desired,
        target_lane_index=("0", "1", lane),
    )
    road.vehicles.append(vehicle)
    return vehicle


def test_the_parameters_are_those_of_highway_env():
    assert ACCELERATION_MPS2 == IDMVehicle.COMFORT_ACC_MAX
    assert COMFORT_BRAKING_MPS2 == -IDMVehicle.COMFORT_ACC_MIN
    assert DISTANCE_WANTED_M == IDMVehicle.DISTANCE_WANTED
    assert TIME_WANTED_S == IDMVehicle.TIME_WANTED
    assert CAR_LENGTH_M == Vehicle.LENGTH
    assert MAX_BRAKING_MPS2 == IDMVehicle.ACC_MAX
    assert MIN_GAIN_MPS2 == IDMVehicle.LANE_CHANGE_MIN_ACC_GAIN
    assert MAX_BRAKING_IMPOSED_MPS2 == IDMVehicle.LANE_CHANGE_MAX_BRAKING_IMPOSED


@settings(deadline=None)
@given(speed=speeds, desired=st.floats(1.0, 30.0))
def test_a_free_road_gives_highway_envs_acceleration(speed: float, desired: float):
    vehicle = make_vehicle(make_road(), 100.0, speed, desired)
    ours = idm_acceleration(speed, desired, NO_LEADER_M, 0.0)
    assert ours == pytest.approx(vehicle.acceleration(vehicle), rel=1e-9, abs=1e-9)


@settings(deadline=None)
@given(speed=speeds, desired=st.floats(1.0, 30.0), leader=speeds, gap=st.floats(0.5, 150.0))
def test_a_leader_gives_highway_envs_acceleration(
    speed: float, desired: float, leader: float, gap: float
):
    road = make_road()
    follower = make_vehicle(road, 100.0, speed, desired)
    front = make_vehicle(road, 100.0 + gap + Vehicle.LENGTH, leader, desired)
    theirs = follower.acceleration(follower, front_vehicle=front)
    if follower.desired_gap(follower, front) < 0.0:
        # highway-env squares a negative wanted gap and then brakes for a leader that flees
        theirs = follower.acceleration(follower)
    assert idm_acceleration(speed, desired, gap, leader) == pytest.approx(
        theirs, rel=1e-9, abs=1e-9
    )


@pytest.fixture(scope="module")
def street() -> Town:
    """One street of two lanes in one direction, 1 km long: lane 0 and, to its right, lane 1."""
    specs = (
        LaneSpec(start=(0, 0), end=(1000, 0), road=0, lane_id=-1),
        LaneSpec(start=(0, 3.5), end=(1000, 3.5), road=0, lane_id=-2),
    )
    beside = {"left": np.array([-1, 0], np.int32), "right": np.array([1, -1], np.int32)}
    return make_town(make_lanes(specs)._replace(**beside))


def our_mobil(town: Town, speeds_mps: list[float], places_m: list[float]) -> tuple[bool, float]:
    """Our MOBIL for vehicle 0 on the left lane; 1 is ahead there, others are on the right lane.

    Returns:
        The answer, and the speed that the street allows.
    """
    lanes, tables = town.lanes, traffic_tables(town)
    left, right = 0, 1
    count = len(places_m)
    capacity = Capacity(egos=0, vehicles=count, walkers=0, props=0, junctions=0, signals=0)
    state = views_of(np.zeros(1, state_dtype(capacity)))
    state.kind[:] = ActorKind.CAR
    state.half_length[:] = 0.5 * CAR_LENGTH_M
    state.half_width[:] = 1.0
    state.desired_factor[:] = 1.0
    for name in ("path", "previous_lane", "changing_from", "grant"):
        getattr(state, name)[...] = -1
    state.speed[:] = speeds_mps
    state.lane_m[:] = places_m
    state.lane[:] = [left, left, *[right] * (count - 2)]
    state.path[:, 0] = state.lane
    for actor in range(count):
        place_vehicle(state, lanes, actor)
    occupancy = make_occupancy(lanes.kind.size, count, 0)
    fill_occupancy(occupancy, state, lanes, 0, count)
    answer = _mobil(occupancy, state, lanes, tables, 0, right)
    return bool(answer), float(allowed_speed(state, lanes, tables, 0))


def their_mobil(desired: float, speeds_mps: list[float], places_m: list[float]) -> bool:
    """The same scene, asked of highway-env."""
    highway = make_road()
    lanes = [0, 0, *[1] * (len(places_m) - 2)]
    cars = [
        make_vehicle(highway, x, speed, desired, number)
        for x, speed, number in zip(places_m, speeds_mps, lanes, strict=True)
    ]
    return bool(cars[0].mobil(("0", "1", 1)))


def test_both_leave_a_crawling_leader_for_a_free_lane(street: Town):
    scene = [10.0, 3.0], [300.0, 325.0]
    answer, desired = our_mobil(street, *scene)
    assert answer
    assert their_mobil(desired, *scene)


def test_both_stay_when_the_new_follower_would_have_to_brake_hard(street: Town):
    scene = [10.0, 3.0, 13.0], [300.0, 325.0, 288.0]
    answer, desired = our_mobil(street, *scene)
    assert not answer
    assert not their_mobil(desired, *scene)


@settings(deadline=None, max_examples=200)
@given(
    speeds_mps=st.tuples(*[st.floats(2.0, 13.0)] * 4),
    gaps=st.tuples(*[st.floats(3.0, 80.0)] * 3),
)
def test_whoever_changes_lanes_in_our_traffic_would_in_highway_env(
    street: Town, speeds_mps: tuple[float, ...], gaps: tuple[float, float, float]
):
    """The other way does not hold: ours also keeps a distance from which one can always stop."""
    places = [300.0, 305.0 + gaps[0], 305.0 + gaps[1], 295.0 - gaps[2]]
    answer, desired = our_mobil(street, list(speeds_mps), places)
    if answer:
        assert their_mobil(desired, list(speeds_mps), places)
