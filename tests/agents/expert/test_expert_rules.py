"""The expert's rules on a straight road, where a person can redo the arithmetic."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agents.expert.actors import PULL_OUT_M
from agents.expert.decision import start_progress
from agents.expert.path import CHANGE_ROOM_M
from agents.expert.progress import shift_at
from agents.expert.speed import NO_LIMIT_MPS2, follow, forecast, stop_within, time_to
from agents.expert.visible import Visible
from di_envs.town.lanes import LightState, SignalKind
from di_envs.world.dynamics import longitudinal_acceleration, pedals
from di_envs.world.state import ActorKind
from tests.agents.expert.straight_road import (
    CONFIG,
    HALF_M,
    LIMIT_MPS,
    MODEL,
    Drive,
    make_actors,
    make_crossings,
    make_path,
)

NUMBERS = CONFIG.numbers()


@settings(deadline=None)
@given(speed=st.floats(0.5, 25.0), wanted=st.floats(-7.5, 2.5))
def test_pedals_give_the_acceleration_that_was_wanted(speed: float, wanted: float):
    model = MODEL.parameters()
    throttle, brake = pedals(wanted, speed, model)
    assert throttle == 0.0 or brake == 0.0
    got = longitudinal_acceleration(speed, throttle, brake, model)
    if throttle < 1.0:  # else it is all that the car has
        assert got == pytest.approx(wanted, abs=1e-9)


def test_a_standing_car_is_held():
    assert pedals(-1.0, 0.0, MODEL.parameters()) == (0.0, 1.0)


def test_braking_for_a_point_begins_at_the_braking_distance():
    # 12 m/s with 3 m/s2 need 24 m, and 1.2 m pass until the next decision
    assert stop_within(26.0, 12.0, NUMBERS) > 0.0
    assert stop_within(24.0, 12.0, NUMBERS) < 0.0


def test_a_point_that_comes_up_late_is_braked_for_as_hard_as_it_takes():
    assert stop_within(12.0, 12.0, NUMBERS) == pytest.approx(-6.0)  # 144 / 24
    assert stop_within(1.0, 12.0, NUMBERS) == -CONFIG.emergency_mps2


def test_behind_a_leader_of_equal_speed_the_gap_settles_at_standstill_plus_time_gap():
    gap = CONFIG.standstill_gap_m + 10.0 * CONFIG.time_gap_s
    assert follow(gap, 10.0, 10.0, NUMBERS) == pytest.approx(0.0, abs=1e-9)


def test_a_forecast_from_rest_obeys_the_square_root_of_twice_distance_over_acceleration():
    times = np.empty(60)
    forecast(make_path(limit_mps=100.0), 0.0, 0.0, NUMBERS, times)
    assert time_to(times, 54.0) == pytest.approx(6.0)  # 0.5 x 3 x 36
    assert time_to(times, -1.0) == 0.0


def test_a_lane_change_leads_from_one_lane_to_the_other_without_a_jump():
    path = make_path(change=(50.0, 80.0, 150.0, -3.5))
    waiting = start_progress()._replace(station_m=40.0)
    assert shift_at(path, waiting, 49.9)[0] == 0.0  # the base line is still on the old lane
    assert shift_at(path, waiting, 140.0)[0] == -3.5
    under_way = start_progress()._replace(
        station_m=60.0, changes=1, change_begin_m=60.0, change_length_m=30.0
    )
    assert shift_at(path, under_way, 60.0)[0] == -3.5
    assert shift_at(path, under_way, 75.0)[0] == pytest.approx(-1.75)
    assert shift_at(path, under_way, 90.0) == (0.0, 0.0, 0.0)
    values = [shift_at(path, under_way, s)[0] for s in np.arange(55.0, 95.0, 0.01)]
    slope = 3.5 * 1.875 / 30.0  # of the quintic's middle
    assert np.abs(np.diff(values)).max() == pytest.approx(0.01 * slope, rel=1e-3)


def test_on_a_free_road_the_expert_drives_at_the_limit_and_straight():
    drive = Drive(make_path(), make_actors())
    drive.run(LIMIT_MPS / CONFIG.acceleration_mps2 + 1.0)
    assert drive.speed == pytest.approx(LIMIT_MPS, abs=0.05)
    assert drive.control[1] == pytest.approx(0.0, abs=1e-9)


def test_it_stops_behind_a_standing_car_without_touching_it():
    actors = make_actors(1)
    actors.x[1] = 200.0
    drive = Drive(make_path(), actors)
    drive.run(40.0)
    assert drive.speed < 0.01
    gap = 200.0 - 2.4 - drive.front
    assert 1.0 < gap < 3.5


def test_a_car_on_the_next_lane_does_not_slow_it():
    actors = make_actors(1)
    actors.x[1], actors.y[1] = 120.0, 3.5
    drive = Drive(make_path(), actors)
    drive.run(12.0)
    assert drive.x > 130.0
    assert drive.speed == pytest.approx(LIMIT_MPS, abs=0.05)


def test_a_car_on_another_level_does_not_slow_it():
    actors = make_actors(1)
    actors.x[1], actors.z[1] = 120.0, 8.0
    drive = Drive(make_path(), actors)
    drive.run(12.0)
    assert drive.speed == pytest.approx(LIMIT_MPS, abs=0.05)


def test_it_never_touches_a_leader_that_brakes_as_hard_as_it_can():
    actors = make_actors(1)
    drive = Drive(make_path(), actors)
    drive.place(50.0, 12.0)
    actors.x[1], actors.speed[1] = 50.0 + HALF_M + 14.5 + 2.4, 12.0
    for _ in range(60):
        actors.speed[1] = max(actors.speed[1] - 0.8, 0.0)
        drive.step()
        assert actors.x[1] - 2.4 - drive.front > 0.3
    assert drive.speed < 0.01


def test_a_light_turned_red_stops_the_expert_before_the_line():
    actors = make_actors()
    actors.light[0] = LightState.RED
    drive = Drive(make_path(line_m=150.0), actors)
    drive.run(40.0)
    assert drive.speed < 0.01
    assert 148.5 < drive.front < 150.0
    actors.light[0] = LightState.GREEN
    drive.run(1.0)
    assert drive.speed > 2.0  # it starts at once


@pytest.mark.parametrize("limit_mps", [5.0, 9.0, 14.0, 25.0])
@pytest.mark.parametrize("yellow_at_m", [60.0, 40.0, 30.0, 24.0, 20.0, 16.0, 12.0, 8.0, 4.0, 1.0])
def test_wherever_green_turns_yellow_its_tail_is_over_the_line_before_red_or_it_stops(
    limit_mps: float, yellow_at_m: float
):
    """Nobody sees when green ends: yellow for two seconds, the shortest there is, then red."""
    actors = make_actors()
    drive = Drive(make_path(line_m=150.0, limit_mps=limit_mps), actors)
    drive.place(20.0, limit_mps)
    while 150.0 - drive.front > yellow_at_m:
        drive.step()
    actors.light[0] = LightState.YELLOW
    drive.run(2.0)
    actors.light[0] = LightState.RED
    if drive.front > 150.0:
        assert drive.x - HALF_M - 1.0 > 150.0
    else:
        drive.run(8.0)
        assert drive.front < 150.0


def test_whoever_ignores_lights_runs_them():
    config = dataclasses.replace(CONFIG, ignore_lights=True)
    actors = make_actors()
    actors.light[0] = LightState.RED
    drive = Drive(make_path(line_m=100.0), actors, config=config)
    drive.run(15.0)
    assert drive.x > 120.0


def test_it_stands_at_a_stop_sign_and_then_goes_on():
    path = make_path(line_m=100.0, kind=SignalKind.STOP)
    drive = Drive(path, make_actors())
    slowest = math.inf
    for _ in range(250):
        drive.step()
        if 95.0 < drive.front < 100.0:
            slowest = min(slowest, drive.speed)
    assert slowest < 0.05
    assert drive.x > 130.0


def test_it_waits_for_a_walker_who_crosses():
    actors = make_actors(1)
    actors.kind[1] = ActorKind.WALKER
    actors.half_length[1] = actors.half_width[1] = 0.25
    actors.x[1], actors.y[1] = 60.0, -4.0
    actors.yaw[1], actors.speed[1] = math.pi / 2.0, 1.3
    drive = Drive(make_path(), actors)
    drive.place(30.0, 10.0)
    for _ in range(80):
        drive.step()
        beside = abs(actors.y[1]) < 0.25 + 1.06
        assert not (beside and abs(actors.x[1] - drive.x) < HALF_M + 0.25)
    assert drive.x > 60.0  # the walker is over, and it went on


def test_it_goes_on_beside_a_walker_who_stands_next_to_it():
    actors = make_actors(1)
    actors.kind[1] = ActorKind.WALKER
    actors.half_length[1] = actors.half_width[1] = 0.25
    actors.x[1], actors.y[1] = 62.0, 1.7
    drive = Drive(make_path(), actors)
    drive.place(60.0, 0.0)
    drive.run(5.0)
    assert drive.x > 70.0


def at_the_crossing(station_m: float, speed: float) -> tuple[Drive, Visible]:
    """The car before a junction, and another that comes along the way that crosses its own."""
    actors = make_actors(1)
    actors.x[1], actors.y[1] = 110.0, station_m - 7.0
    actors.yaw[1], actors.speed[1] = math.pi / 2.0, speed
    path = make_path(junction=(100.0, 120.0))
    drive = Drive(path, actors, crossings=make_crossings((8.0, 12.0)))
    drive.place(80.0, 8.0)
    return drive, actors


def test_it_lets_a_car_pass_that_comes_and_then_crosses():
    drive, actors = at_the_crossing(-12.0, 5.0)
    for _ in range(150):
        drive.step()
        if actors.y[1] + 7.0 - 2.4 < 9.0:  # it has not left the crossing place
            assert drive.front < 100.0 + 8.0
    assert drive.x > 120.0


def test_it_goes_before_one_who_stands_at_his_line_or_brakes_for_it():
    for station_m, speed, braking in ((-3.5, 0.0, 0), (-30.0, 8.0, 1)):
        drive, actors = at_the_crossing(station_m, speed)
        actors.brake_light[1] = braking
        for _ in range(60):
            drive.step()
            actors.speed[1] = max(actors.speed[1] - 0.15, 0.0)  # 1.5 m/s2: he stops in 21 m
        assert drive.x > 115.0


def test_it_waits_for_one_who_comes_too_fast_to_stop_at_his_line_though_he_brakes():
    drive, actors = at_the_crossing(-16.0, 11.0)
    actors.brake_light[1] = 1  # 121 / (2 x 14.1): he would need 4.3 m/s2
    drive.place(92.0, 6.0)
    drive.step()
    assert drive.control[2] > 0.0


def test_it_takes_its_turn_when_somebody_stands_inside_the_junction_and_waits_too():
    drive, _ = at_the_crossing(3.0, 0.0)
    drive.place(99.3 - HALF_M, 0.0)
    drive.run(1.5)
    assert drive.front < 100.0
    drive.run(9.0)
    assert drive.x > 120.0


def test_it_does_not_enter_a_junction_whose_exit_is_full():
    actors = make_actors(1)
    actors.x[1] = 120.0 + 4.0 + 2.4  # room for 4 m beyond the junction; it needs 6.9
    drive = Drive(make_path(junction=(100.0, 120.0)), actors)
    drive.run(30.0)
    assert drive.front < 100.0
    actors.x[1] += 4.0
    drive.run(10.0)
    assert drive.front > 115.0


def test_a_lane_change_waits_for_the_gap_and_is_made_when_it_is_free():
    actors = make_actors(1)
    drive = Drive(make_path(change=(50.0, 88.0, 102.0, -3.5)), actors)
    drive.place(60.0, 8.0)
    actors.y[0] = -3.5  # on the old lane; the new one is y = 0
    actors.x[1], actors.speed[1] = 59.0, 8.0
    drive.step()
    assert drive.progress.changes == 0
    actors.x[1] = 20.0
    drive.step()
    assert drive.progress.changes == 1


def test_without_a_gap_it_stops_where_the_change_must_begin():
    actors = make_actors(1)
    drive = Drive(make_path(change=(50.0, 88.0, 102.0, -3.5)), actors)
    drive.place(50.0, 10.0)
    actors.y[0] = -3.5
    for _ in range(150):
        actors.x[1] = drive.x - 1.0  # somebody keeps beside it
        drive.step()
    assert drive.progress.changes == 0
    assert drive.speed < 0.05
    assert drive.x < 88.5


def test_it_does_not_change_lanes_before_one_who_comes_fast_from_far_behind():
    """At 26 m/s he would have to brake by 4 m/s2 within the 85 m between them."""
    actors = make_actors(1)
    drive = Drive(make_path(change=(100.0, 188.0, 202.0, -3.5)), actors)
    drive.place(150.0, 0.0)
    actors.y[0] = -3.5
    actors.x[1], actors.speed[1] = 60.0, 26.0
    drive.step()
    assert drive.progress.changes == 0


def test_a_lane_change_that_it_only_stands_before_is_taken_back_when_somebody_comes():
    actors = make_actors(1)
    drive = Drive(make_path(line_m=57.0, change=(50.0, 88.0, 102.0, -3.5)), actors)
    drive.place(53.0, 0.0)
    actors.y[0] = -3.5
    actors.light[0] = LightState.RED
    drive.run(0.5)
    actors.x[1] = drive.x  # he stands on the new lane, beside it
    actors.light[0] = LightState.GREEN
    drive.run(2.0)
    assert drive.speed > 0.0
    assert drive.progress.changes == 0


def test_behind_a_change_it_sees_who_comes_on_the_lane_of_the_next():
    """The path behind the car is still on the first of three lanes, y = -7, -3.5 and 0."""
    path = make_path(change=(50.0, 70.0, 90.0, -3.5))
    path = path._replace(
        y=np.where(path.x < 50.0, -7.0, np.where(path.x < 90.0, -3.5, 0.0)),
        change_jump_m=np.array([50.0, 90.0]),
        change_latest_m=np.array([70.0, 138.0]),
        change_limit_m=np.array([90.0, 152.0]),
        change_shift_m=np.array([-3.5, -3.5]),
    )
    for behind_m, changes in ((25.0, 1), (60.0, 2)):
        actors = make_actors(1)
        drive = Drive(path, actors)
        drive.place(95.0, 20.0)
        drive.progress = drive.progress._replace(
            changes=1, change_begin_m=60.0, change_length_m=30.0
        )
        actors.y[0] = -3.5
        actors.x[1], actors.speed[1] = 95.0 - behind_m, 25.0
        drive.step()
        assert drive.progress.changes == changes


def test_it_slows_down_for_a_lane_change_that_has_little_room():
    """In 34 m it changes at 20 m/s at most, which is in 1.7 s."""
    for speed, changes in ((25.0, 0), (19.9, 1)):
        actors = make_actors()
        drive = Drive(make_path(change=(50.0, 72.0, 86.0, -3.5), limit_mps=30.0), actors)
        drive.place(50.0, speed)
        actors.y[0] = -3.5
        drive.step()
        assert drive.progress.changes == changes
        assert (drive.speed < speed) == (changes == 0)


def test_beside_one_who_turns_as_it_does_it_goes_on():
    """He shows where he turns, not that he comes over; on the road before he would come over."""
    for junction, goes in (((100.0, 120.0), True), (None, False)):
        actors = make_actors(1)
        drive = Drive(make_path(junction=junction), actors)
        drive.place(108.0, 0.0)
        actors.x[1], actors.y[1], actors.yaw[1], actors.indicator[1] = 110.0, -3.5, 0.2, 1
        drive.run(0.5)
        assert (drive.speed > 0.5) == goes


@settings(deadline=None, max_examples=30)
@given(
    x=st.floats(1.0, 300.0),
    y=st.floats(-20.0, 20.0),
    yaw=st.floats(-10.0, 10.0),
    speed=st.floats(0.0, 30.0),
    other=st.tuples(st.floats(-50.0, 80.0), st.floats(-8.0, 8.0), st.floats(-4.0, 4.0)),
)
def test_controls_are_finite_and_in_range_wherever_the_car_is(
    x: float, y: float, yaw: float, speed: float, other: tuple[float, float, float]
):
    actors = make_actors(1)
    drive = Drive(make_path(line_m=200.0), actors)
    drive.place(x, speed)
    actors.y[0], actors.yaw[0] = y, yaw
    actors.x[1], actors.y[1], actors.yaw[1] = x + other[0], y + other[1], other[2]
    actors.speed[1] = 5.0
    drive.step()
    throttle, steer, brake = drive.control
    assert 0.0 <= throttle <= 1.0
    assert -1.0 <= steer <= 1.0
    assert 0.0 <= brake <= 1.0


def test_no_stop_is_no_limit():
    assert stop_within(1e6, 10.0, NUMBERS) > 100.0
    assert CONFIG.acceleration_mps2 < NO_LIMIT_MPS2


def test_it_does_not_follow_a_crawling_queue_over_the_line():
    actors = make_actors(1)
    actors.x[1], actors.speed[1] = 152.0, 2.0  # its rear has just crossed the line
    drive = Drive(make_path(line_m=150.0), actors)
    drive.place(140.0, 4.0)
    for _ in range(60):
        actors.speed[1] = max(actors.speed[1] - 0.05, 0.0)
        drive.step()
    assert drive.front < 150.0


def test_with_its_tail_on_the_line_at_red_a_crawling_car_waits_for_green():
    actors = make_actors()
    actors.light[0] = LightState.RED
    drive = Drive(make_path(line_m=150.0), actors)
    drive.place(150.0, 1.0)
    drive.run(10.0)
    # the rule's tail begins at 0.8 half lengths behind the centre
    assert drive.x - 0.8 * HALF_M < 150.0
    actors.light[0] = LightState.GREEN
    drive.run(5.0)
    assert drive.x > 160.0


def test_from_behind_a_standing_lorry_the_shortest_lane_change_clears_its_corner():
    """The rear axle follows the path; the right side of the car must pass the lorry's left rear."""
    length, width, lorry = CHANGE_ROOM_M, 3.5, 1.25
    corner_x, corner_y = HALF_M + PULL_OUT_M, lorry
    station = np.linspace(0.0, length, 400)
    u = station / length
    rear_y = width * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    yaw = np.arctan(width * 30.0 * u**2 * (1.0 - u) ** 2 / length)
    dx, dy = corner_x - station, corner_y - rear_y
    ahead = np.cos(yaw) * dx + np.sin(yaw) * dy - MODEL.rear_axle_m
    left = np.cos(yaw) * dy - np.sin(yaw) * dx  # it pulls out towards positive y
    beside = np.abs(ahead) < HALF_M
    assert (-left[beside] - MODEL.half_width_m).min() > CONFIG.side_margin_m
    assert (ahead[left > -MODEL.half_width_m] > HALF_M).all()
