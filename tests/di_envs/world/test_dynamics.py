"""Ego dynamics by arithmetic, and against the published polynomial that they were fitted to."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from di_envs.world.dynamics import EgoModel, locate_ego, longitudinal_acceleration, move_ego
from di_envs.world.state import HISTORY_LENGTH, TICK_S
from tests.di_envs.world.small_world import BRIDGE, EAST, EAST_RIGHT, make_lanes, make_state

LINCOLN = EgoModel().parameters()
FREE = EgoModel(drag_per_s=0.0).parameters()

# PDM-Lite's polynomial: km/h after a tick of 0.05 s from the features below, v in km/h
PUBLISHED = (
    0.963873001,
    4.37535692e-4,
    -0.380192912,
    1.74950069,
    0.0916787414,
    -0.0705461530,
    -1.05996152e-3,
    6.71079346e-4,
)


def drive(state, model, ticks, throttle=0.0, steer=0.0, brake=0.0):
    state.throttle[0], state.steer[0], state.brake[0] = throttle, steer, brake
    for _ in range(ticks):
        state.tick[()] += 1
        move_ego(state, 0, model)


def test_ten_seconds_at_eight_metres_per_second_cover_eighty_metres():
    state = make_state()
    state.speed[0] = 8.0
    drive(state, FREE, 200)
    assert state.x[0] == pytest.approx(80.0, abs=1e-9)
    assert state.y[0] == 0.0


def test_full_throttle_pulls_away_at_the_published_rate():
    state = make_state()
    drive(state, LINCOLN, 1, throttle=1.0)
    assert state.acceleration[0] == pytest.approx(9.72 - 2.11)
    assert state.speed[0] == pytest.approx(7.61 * TICK_S)


def test_little_throttle_does_not_move_the_car():
    state = make_state()
    drive(state, LINCOLN, 20, throttle=0.2)  # 9.72 * 0.04 < 2.11 * 0.2
    assert state.speed[0] == 0.0
    assert state.x[0] == 0.0


def test_full_brake_from_twenty_stops_in_twenty_five_metres():
    state = make_state()
    state.speed[0] = 20.0
    drive(state, FREE, 50, brake=1.0)  # 20 / 8 = 2.5 s; 20² / 16 = 25 m
    assert state.speed[0] == pytest.approx(0.0, abs=1e-9)
    assert state.x[0] == pytest.approx(25.0, abs=1e-9)


def test_a_standing_car_that_brakes_does_not_reverse():
    state = make_state()
    drive(state, LINCOLN, 10, brake=1.0)
    assert (state.speed[0], state.x[0], state.acceleration[0]) == (0.0, 0.0, 0.0)


def test_the_brake_wins_over_the_throttle():
    state = make_state()
    state.speed[0] = 10.0
    drive(state, LINCOLN, 1, throttle=1.0, brake=1.0)
    assert state.speed[0] < 10.0


def test_positive_steer_turns_right():
    state = make_state()
    state.speed[0] = 5.0
    drive(state, FREE, 10, steer=0.5)
    assert state.yaw[0] > 0.0
    assert state.y[0] > 0.0
    assert state.yaw_rate[0] > 0.0


def test_the_steering_reaches_sixty_three_per_cent_in_a_tenth_of_a_second():
    state = make_state()
    drive(state, LINCOLN, 2, steer=1.0)
    assert state.wheel[0] == pytest.approx(1.0 - math.exp(-1.0))


def test_a_full_turn_at_constant_wheel_ends_where_it_began():
    state = make_state()
    ticks = 400
    beta = math.atan(1.4178275 / (1.4178275 - 0.090769015) * math.tan(0.36848336))
    radius = 1.4178275 / math.sin(beta)
    state.wheel[0] = 1.0
    state.speed[0] = 2.0 * math.pi * radius / (ticks * TICK_S)
    drive(state, FREE, ticks // 2, steer=1.0)
    middle = math.hypot(state.x[0], state.y[0])
    assert middle == pytest.approx(2.0 * radius, rel=1e-4)
    drive(state, FREE, ticks // 2, steer=1.0)
    assert math.hypot(state.x[0], state.y[0]) < 1e-9
    assert abs(math.sin(state.yaw[0])) < 1e-9


def test_acceleration_follows_the_published_polynomial_within_the_stated_error():
    speed, throttle = np.meshgrid(np.linspace(0.0, 20.0, 101), np.linspace(0.3, 1.0, 71))
    kmh = speed * 3.6
    features = (
        kmh,
        kmh**2,
        throttle,
        throttle**2,
        kmh * throttle,
        kmh * throttle**2,
        kmh**2 * throttle,
        kmh**2 * throttle**2,
    )
    after = sum(weight * feature for weight, feature in zip(PUBLISHED, features, strict=True))
    published = (after - kmh) / 3.6 / TICK_S
    ours = np.vectorize(lambda v, t: longitudinal_acceleration(v, t, 0.0, LINCOLN))(speed, throttle)
    assert np.sqrt(np.mean((ours - published) ** 2)) == pytest.approx(0.44, abs=0.01)
    assert np.abs(ours - published).max() < 1.15


def test_the_speed_history_holds_each_tick_in_its_place():
    state = make_state()
    state.speed[0] = 10.0
    drive(state, FREE, HISTORY_LENGTH + 5, brake=0.125)  # 1 m/s²: 0.05 m/s a tick
    now = int(state.tick[()])
    for ago in (0, 10, 40):
        speed = state.speed_history[0, (now - ago) % HISTORY_LENGTH]
        assert speed == pytest.approx(10.0 - 0.05 * (now - ago))


@settings(max_examples=50, deadline=None)
@given(
    controls=st.lists(
        st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)),
        min_size=1,
        max_size=40,
    ),
    speed=st.floats(0.0, 34.0),
)
def test_no_control_makes_the_car_reverse_or_exceed_its_drive(controls, speed):
    state = make_state()
    state.speed[0] = speed
    for throttle, steer, brake in controls:
        drive(state, LINCOLN, 3, throttle, steer, brake)
    assert 0.0 <= state.speed[0] <= 35.0
    assert np.isfinite((state.x[0], state.y[0], state.yaw[0], state.yaw_rate[0])).all()
    assert -math.pi <= state.yaw[0] < math.pi
    assert -1.0 <= state.wheel[0] <= 1.0


def test_an_ego_is_on_the_nearest_lane_and_its_box_on_all_below_it():
    state, lanes = make_state(), make_lanes()
    state.x[0], state.y[0] = 70.0, 1.2
    locate_ego(state, lanes, 0)
    assert state.lane[0] == EAST
    assert state.lane_m[0] == pytest.approx(70.0)
    assert state.lateral_m[0] == pytest.approx(1.2)
    assert list(state.occupied[0]) == [EAST, EAST_RIGHT, -1, -1]


@pytest.mark.parametrize(("z", "lane"), [(0.0, EAST), (10.0, BRIDGE)])
def test_an_ego_under_a_bridge_is_not_on_it(z, lane):
    state, lanes = make_state(), make_lanes()
    state.x[0], state.y[0], state.z[0] = 50.0, 0.1, z
    locate_ego(state, lanes, 0)
    assert state.lane[0] == lane
    assert state.z[0] == z
    assert list(state.occupied[0])[:2] == [lane, -1]


def test_an_ego_far_from_all_lanes_is_on_none():
    state, lanes = make_state(), make_lanes()
    state.x[0], state.y[0] = 70.0, 500.0
    locate_ego(state, lanes, 0)
    assert state.lane[0] == -1
    assert list(state.occupied[0]) == [-1, -1, -1, -1]


def test_a_model_without_wheelbase_is_refused():
    with pytest.raises(ValueError, match="wheelbase"):
        EgoModel(front_axle_m=-2.0)
    with pytest.raises(ValueError, match="brake_mps2 must be positive"):
        EgoModel(brake_mps2=0.0)
