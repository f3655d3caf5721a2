"""Each event of Leaderboard 1.0 on a hand-made street, and the traps of its rules."""

import math

import numpy as np
import pytest

from di_envs.town.lanes import LightState, SignalKind
from di_envs.world.dynamics import EgoModel, locate_ego
from di_envs.world.events.progress import advance_progress
from di_envs.world.events.red_light import segments_cross
from di_envs.world.events.watching import begin_events, detect_events
from di_envs.world.state import TICK_S, EventKind
from tests.di_envs.world.small_world import (
    BRIDGE,
    EAST,
    EAST_RIGHT,
    JUNCTION,
    LANES,
    ONCOMING,
    make_lanes,
    make_routes,
    make_signals,
    make_state,
    rows,
    with_lane,
)

HALF = EgoModel().half_length_m
NO_SIGNALS = make_signals(SignalKind.YIELD)  # a kind that no rule looks at


class Street:
    """Puts one ego somewhere, tick by tick, and collects what is detected.

    The first place is where it has come to on its route, unless `follows` is off. What `di-1.0`
    sees of red lights in the place of CARLA's rules is left out unless `wide` is on.
    """

    def __init__(self, signals=NO_SIGNALS, lanes=None, routes=None, follows=True, wide=False):
        self.unseen = () if wide else (EventKind.RED_LIGHT_WIDE,)
        self.state = make_state()
        self.signals = signals
        self.lanes = lanes or make_lanes()
        self.routes = routes or make_routes()
        self.rows = []
        self.state.light[0] = LightState.RED
        self.follows = follows

    def put(self, x, y=0.0, yaw=0.0, speed=10.0, z=0.0):
        state, out = self.state, rows()
        if state.tick[()] == 0 and self.follows:
            self.start_at(int(x))
        state.tick[()] += 1
        state.x[0], state.y[0], state.z[0] = x, y, z
        state.yaw[0], state.speed[0] = yaw, speed
        locate_ego(state, self.lanes, 0)
        advance_progress(state, self.routes, 0)
        n = detect_events(state, self.lanes, self.signals, self.routes, 0, 1, out, 0)
        seen = [row for row in out[:n] if row[0] not in self.unseen]
        self.rows += seen
        return [EventKind(int(row[0])) for row in seen]

    def start_at(self, point):
        for index in ("route_index", "deviation_index", "outside_index"):
            getattr(self.state, index)[0] = point

    def drive(self, begin, end, step=0.5, **pose):
        events = []
        for x in np.arange(begin, end, math.copysign(step, end - begin)):
            events += self.put(float(x), **pose)
        return events

    def kinds(self):
        return [EventKind(int(row[0])) for row in self.rows]


# red light: the stop line is at x = 100


def test_running_a_red_light_is_fined_when_the_tail_crosses_not_the_nose():
    street = Street(make_signals())
    assert street.drive(80.0, 100.0 + 0.8 * HALF - 0.01, step=0.1) == []
    assert street.put(100.0 + 0.8 * HALF + 0.01) == [EventKind.RED_LIGHT]


def test_the_tail_reaches_one_metre_behind_the_bumper():
    street = Street(make_signals())
    assert street.put(100.0 + HALF + 1.0 + 0.01) == []
    assert street.put(100.0 + HALF + 1.0 - 0.01) == [EventKind.RED_LIGHT]


@pytest.mark.parametrize("light", [LightState.YELLOW, LightState.GREEN])
def test_yellow_is_free_like_green(light):
    street = Street(make_signals())
    street.state.light[0] = light
    assert street.drive(80.0, 115.0) == []


def test_a_light_that_turns_red_under_the_ego_still_fines_its_tail():
    street = Street(make_signals())
    street.state.light[0] = LightState.GREEN
    street.drive(95.0, 102.5)
    street.state.light[0] = LightState.RED
    assert street.put(102.6) == [EventKind.RED_LIGHT]


def test_a_tail_that_has_passed_is_free():
    street = Street(make_signals())
    assert street.drive(100.0 + HALF + 1.1, 118.0) == []


def test_the_light_that_fined_last_does_not_fine_again():
    street = Street(make_signals())
    assert street.drive(90.0, 110.0).count(EventKind.RED_LIGHT) == 1
    assert street.drive(90.0, 110.0) == []
    assert street.state.counts[0, EventKind.RED_LIGHT] == 1


def test_the_fine_names_the_signal_and_its_place():
    street = Street(make_signals())
    street.drive(90.0, 110.0)
    tick = street.rows[0][2]
    assert list(street.rows[0]) == [EventKind.RED_LIGHT, 0, tick, 100.0, 7.0, 0.0, 0.0, 0.0]
    assert 1 <= tick <= 40


def test_the_stop_line_spans_four_tenths_of_the_lane_to_each_side():
    for y, fined in ((1.39, True), (1.41, False)):  # 0.4 * 3.5 = 1.4
        street = Street(make_signals())
        assert (street.drive(95.0, 110.0, y=y) == [EventKind.RED_LIGHT]) == fined


# the eastbound lanes lie from y = -1.75 to 5.25, the oncoming one beyond y = -1.75
@pytest.mark.parametrize(
    ("y", "short", "wide"),
    [
        (0.0, True, True),
        (1.39, True, True),
        (1.41, False, True),  # at the edge of the lane
        (1.75, False, True),  # between the lanes
        (5.2, False, True),
        (6.54, False, True),  # beside the road, by less than 1.3 m
        (6.56, False, False),  # further out metres outside the lanes are counted
        (-1.8, False, True),  # on the wrong side of the road
        (-3.04, False, True),
        (-3.06, False, False),
    ],
)
def test_the_wide_line_has_no_edge_at_which_a_red_light_is_free(y, short, wide):
    street = Street(make_signals(), wide=True)
    fined = street.drive(95.0, 110.0, y=y)
    assert (EventKind.RED_LIGHT in fined) == short
    assert fined.count(EventKind.RED_LIGHT_WIDE) == wide


def test_a_lane_beside_that_goes_by_no_light_is_free_of_the_wide_line():
    signals = make_signals()
    signals = signals._replace(stop_signal=np.array([0, -1], np.int32))
    street = Street(signals, wide=True)
    assert street.drive(95.0, 110.0, y=2.0) == []  # on the right lane, 2 m from the left one's line


def test_the_wide_line_fines_once_for_each_time_the_light_was_not_the_last():
    street = Street(make_signals(), wide=True)
    assert street.drive(90.0, 110.0, y=1.5) == [EventKind.RED_LIGHT_WIDE]
    assert street.drive(90.0, 110.0) == [EventKind.RED_LIGHT]


@pytest.mark.parametrize(("share", "fined"), [(0.5, True), (0.9, False), (1.0, False)])
def test_hugging_the_lanes_edge_evades_the_red_light_though_one_is_in_the_lane(share, fined):
    """A hole in Leaderboard 1.0's rule: its line leaves a fifth of the lane open to each side."""
    for side in (-1.0, 1.0):
        street = Street(make_signals())
        events = street.drive(80.0, 115.0, y=side * share * 3.5 / 2.0, step=0.1)
        assert events == ([EventKind.RED_LIGHT] if fined else [])  # nor is it outside its lane


def test_going_the_other_way_over_a_stop_line_is_free():
    street = Street(make_signals())
    assert EventKind.RED_LIGHT not in street.drive(110.0, 90.0, yaw=math.pi)


def test_a_light_whose_box_is_over_fifteen_metres_away_does_not_fine():
    signals = make_signals()
    far = signals._replace(box=signals.box + np.array([-13.0, 0, 0, 0, 0, 0]))  # at x = 84
    street = Street(far)
    assert street.drive(95.0, 110.0) == []  # the tail crosses when the ego is past x = 101.96


def test_a_light_below_a_bridge_does_not_fine_those_on_it():
    lanes = make_lanes(with_lane(LANES, BRIDGE, start=(60.0, 0.0), end=(140.0, 0.0)))
    street = Street(make_signals(), lanes=lanes)
    assert street.drive(90.0, 110.0, z=10.0) == []


def test_crossing_segments():
    assert segments_cross(0.0, 0.0, 2.0, 0.0, 1.0, -1.0, 1.0, 1.0)
    assert segments_cross(0.0, 0.0, 1.0, 0.0, 1.0, -1.0, 1.0, 1.0)  # touching
    assert not segments_cross(0.0, 0.0, 0.9, 0.0, 1.0, -1.0, 1.0, 1.0)
    assert not segments_cross(0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 2.0, 1.0)


# stop sign: the trigger box is x 95.5 to 98.5, y -1.25 to 4.75; the sign stands at its side

NEAR_SIGN = make_signals(SignalKind.STOP, pole=(97.0, 1.75))
FAR_SIGN = make_signals(SignalKind.STOP, pole=(97.0, 7.0))


def test_driving_past_a_stop_sign_is_fined_once_its_box_is_behind():
    street = Street(NEAR_SIGN)
    assert street.drive(70.0, 98.5) == []
    assert street.put(98.6) == [EventKind.STOP_SIGN]
    assert street.drive(99.0, 119.0) == []


def test_standing_before_the_stop_sign_is_enough():
    street = Street(NEAR_SIGN)
    street.drive(70.0, 90.0)
    street.put(90.0, speed=0.09)
    assert street.drive(90.0, 119.0) == []


def test_slowing_down_to_a_crawl_is_not_standing():
    street = Street(NEAR_SIGN)
    street.drive(70.0, 90.0)
    street.put(90.0, speed=0.1)
    assert street.drive(90.0, 119.0) == [EventKind.STOP_SIGN]


def test_standing_before_the_sign_is_seen_does_not_count():
    street = Street(NEAR_SIGN)
    street.put(75.0, speed=0.0)  # the last of 20 points ahead is at 95, the box begins at 95.5
    assert street.state.stop_target[0] == -1
    street.put(76.0)
    assert street.state.stop_target[0] == 0
    assert street.drive(77.0, 119.0) == [EventKind.STOP_SIGN]


def test_a_sign_that_stands_far_from_its_lane_never_fines():
    street = Street(FAR_SIGN)  # the box around the sign is y 4 to 10
    assert street.drive(70.0, 119.0) == []
    assert street.state.stop_target[0] == -1


def test_an_ego_against_its_lane_is_not_watched():
    street = Street(NEAR_SIGN)
    street.put(97.0, yaw=math.pi)
    assert street.state.stop_target[0] == -1


def test_a_box_turned_by_a_quarter_swaps_its_sides():
    turned = NEAR_SIGN._replace(box=np.array([[97.0, 1.75, 0.0, math.pi / 2, 3.0, 1.5]]))
    street = Street(turned)
    assert street.drive(70.0, 98.5) == []
    assert street.put(98.6) == [EventKind.STOP_SIGN]


def test_a_stop_sign_is_seen_across_the_end_of_a_lane():
    box = np.array([[110.0, 0.0, 0.0, 0.0, 1.5, 3.0]])  # within the junction
    street = Street(NEAR_SIGN._replace(box=box, pose=np.array([[110.0, 2.0, 0.0, 0.0]])))
    street.put(88.0)
    assert street.state.stop_target[0] == -1
    street.put(89.0)  # 20 m ahead lies at 109, on the next lane
    assert street.state.stop_target[0] == 0


# lanes: y = 0 and 3.5 eastwards, -3.5 westwards, parking at 6.25 from x = 20 to 60


def test_the_metres_outside_lanes_are_reported_once_at_the_end():
    street = Street(routes=make_routes(timeout_s=20.0))
    street.drive(0.0, 70.0, y=3.5)  # a lane of the same direction is fine
    assert street.state.outside_m[0] == 0.0
    street.drive(70.0, 80.05, y=3.5 + 1.75 + 1.31)
    assert street.state.outside_lane[0] == 1
    street.drive(80.5, 90.0)
    assert street.kinds() == []
    assert street.state.outside_m[0] == 10.0  # points 70 to 79: the last to be passed is 79
    street.state.tick[()] = 400
    assert street.put(90.0) == [EventKind.OUTSIDE_LANES, EventKind.TIMEOUT]
    assert street.rows[0][7] == 10.0
    assert street.put(90.0) == []


def test_lanes_may_be_left_by_a_metre_and_three_tenths():
    for y, outside in ((3.5 + 1.75 + 1.29, 0), (3.5 + 1.75 + 1.31, 1)):
        street = Street()
        street.put(80.0, y=y)
        assert street.state.outside_lane[0] == outside


def test_a_parking_lane_is_no_place_outside():
    for y, outside in ((7.0, 0), (6.25 + 1.0 + 1.29, 0), (6.25 + 1.0 + 1.31, 1)):
        street = Street()
        street.put(40.0, y=y)
        assert street.state.outside_lane[0] == outside


def test_far_from_everything_is_outside():
    street = Street()
    street.put(80.0, y=300.0)
    assert street.state.lane[0] == -1
    assert street.state.outside_lane[0] == 1


def test_changing_to_a_lane_of_the_same_direction_is_not_wrong():
    street = Street()
    street.put(40.0)
    street.put(41.0, y=3.5)
    assert street.state.wrong_lane[0] == 0


def test_changing_into_the_oncoming_lane_is_wrong_until_it_is_left():
    street = Street()
    street.put(40.0)
    street.put(41.0, y=-3.5)
    assert street.state.wrong_lane[0] == 1
    street.drive(42.0, 52.0, y=-3.5)
    street.put(52.0)
    assert street.state.wrong_lane[0] == 0
    assert street.state.outside_m[0] > 5.0


def test_driving_against_the_lane_without_changing_it_is_not_noticed():
    street = Street()
    street.drive(40.0, 20.0, yaw=math.pi)
    assert street.state.wrong_lane[0] == 0


def test_junctions_clear_the_wrong_lane():
    street = Street()
    street.state.wrong_lane[0] = 1
    street.put(110.0)
    assert street.state.lane[0] == JUNCTION
    assert street.state.wrong_lane[0] == 0


@pytest.mark.parametrize(("degrees", "wrong"), [(119.0, 0), (121.0, 1)])
def test_leaving_a_junction_against_the_lane_is_wrong_from_120_degrees(degrees, wrong):
    street = Street()
    street.put(119.0)
    street.put(121.0, yaw=math.radians(degrees))
    assert street.state.wrong_lane[0] == wrong


def test_another_lane_of_the_same_direction_clears_a_wrong_lane():
    lanes = make_lanes(with_lane(LANES, EAST_RIGHT, start=(0.0, -7.0), end=(100.0, -7.0)))
    lanes = lanes._replace(points=lanes.points.copy())
    own = slice(lanes.first[EAST_RIGHT], lanes.first[EAST_RIGHT] + lanes.count[EAST_RIGHT])
    lanes.points[own, 3] = math.pi  # a second oncoming lane beside the first
    street = Street(lanes=lanes)
    for y, lane, wrong in ((0.0, EAST, 0), (-3.5, ONCOMING, 1), (-7.0, EAST_RIGHT, 0)):
        street.put(40.0, y=y)
        assert (street.state.lane[0], street.state.wrong_lane[0]) == (lane, wrong)


def test_metres_are_counted_over_at_most_three_points_a_tick():
    street = Street(follows=False)
    street.put(20.5, y=300.0)
    assert street.state.outside_index[0] == 3
    assert street.state.outside_m[0] == street.state.outside_done_m[0] == 3.0


# the ends of a route


def test_over_thirty_metres_from_the_route_ends_it():
    street = Street()
    assert street.put(0.0, y=29.9) == []
    assert street.put(0.0, y=30.0) == [EventKind.ROUTE_DEVIATION]
    assert street.state.finished[0] == EventKind.ROUTE_DEVIATION
    assert street.put(0.0, y=99.0) == []


def test_the_deviation_looks_five_points_ahead_only():
    street = Street(follows=False)
    assert street.put(34.9) == []  # point 5 is 29.9 m away
    street = Street(follows=False)
    assert street.put(35.1) == [EventKind.ROUTE_DEVIATION]


def test_thirty_per_cent_over_fifteen_metres_off_end_it_and_the_metres_are_reported():
    street = Street()  # 200 m: 60 m may be passed that way
    assert street.drive(0.0, 60.5, y=15.1) == []
    ended = street.put(60.5, y=15.1)  # from here point 61 is as near as point 60
    assert ended == [EventKind.OUTSIDE_LANES, EventKind.ROUTE_DEVIATION]
    assert street.state.deviation_m[0] == 61.0


def test_under_fifteen_metres_off_is_no_deviation():
    street = Street()
    assert street.drive(0.0, 150.0, y=14.9) == []
    assert street.state.deviation_m[0] == 0.0


def test_standing_for_over_three_minutes_is_blocked():
    street = Street()
    ticks = 0
    while not (events := street.put(10.0, speed=0.09)):
        ticks += 1
    assert events == [EventKind.BLOCKED]
    assert ticks * TICK_S == pytest.approx(180.0)


def test_moving_once_starts_the_three_minutes_anew():
    street = Street()
    for _ in range(3600):
        street.put(10.0, speed=0.0)
    street.put(10.0, speed=0.1)
    assert street.state.blocked_ticks[0] == 0
    assert street.put(10.0, speed=0.0) == []


def test_the_timeout_comes_after_its_game_time():
    street = Street(routes=make_routes(timeout_s=2.0))
    for _ in range(40):
        assert street.put(10.0) == []
    assert street.put(10.0) == [EventKind.TIMEOUT]


def test_a_driven_route_is_completed_in_full():
    street = Street()
    street.drive(0.0, 199.0)
    assert street.put(199.5) == [EventKind.COMPLETED]
    assert street.state.finished[0] == EventKind.COMPLETED
    assert street.state.route_done_m[0] == 200.0
    assert street.state.counts[0, EventKind.COMPLETED] == 1


def test_a_route_completed_in_the_tick_of_its_timeout_is_completed():
    street = Street(routes=make_routes(timeout_s=1.0))
    street.start_at(198)
    street.state.tick[()] = 100
    street.state.route_done_m[0] = 199.0
    assert street.put(199.5) == [EventKind.COMPLETED]


def test_a_new_route_starts_with_no_memory():
    street = Street(make_signals())
    street.drive(80.0, 120.0)
    begin_events(street.state, 0)
    fresh = make_state()
    for name in fresh._fields:
        if name.startswith(("last_", "stop_", "outside_", "deviation", "blocked", "counts")):
            assert np.array_equal(getattr(street.state, name), getattr(fresh, name)), name
