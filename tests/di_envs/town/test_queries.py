"""Queries against plain arithmetic and against searches that look at everything."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from di_envs.town.lanes import LaneKind
from di_envs.town.lanes_below import lanes_below_box
from di_envs.town.queries import (
    DRIVING_MASK,
    nearest_driving_lane_towards,
    nearest_lane,
    pose_at,
    project_to_lane,
    width_at,
)
from tests.di_envs.town.small_maps import crossing, geometry, lane, load, opendrive, road, section


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """100 m along x: lane 0 runs west at y = -1.75, lane 1 east at y = 1.75, with a sidewalk."""
    walk = lane(-2, kind="sidewalk", width='<width sOffset="0" a="2" b="0" c="0" d="0"/>')
    narrowing = '<width sOffset="0" a="4" b="-0.01" c="0" d="0"/>'
    text = opendrive(road("1", 100.0, section(0.0, lane(1), lane(-1, width=narrowing), walk)))
    return load(text, tmp_path_factory.mktemp("street")).lanes


@pytest.fixture(scope="module")
def junction(tmp_path_factory):
    return load(crossing(2), tmp_path_factory.mktemp("crossing")).lanes


@pytest.fixture(scope="module")
def bridge(tmp_path_factory):
    """A street along x, and one along y that crosses it 6 m above."""
    up = '<elevationProfile><elevation s="0" a="6" b="0" c="0" d="0"/></elevationProfile>'
    text = opendrive(
        road("1", 100.0, section(0.0, lane(-1))),
        road("2", 100.0, section(0.0, lane(-1)), before=up, x=50.0, y=-50.0, heading=math.pi / 2),
    )
    return load(text, tmp_path_factory.mktemp("bridge")).lanes


def only(lanes, lane_id):
    (found,) = np.flatnonzero(lanes.lane_id == lane_id)
    return int(found)


def test_a_pose_lies_between_its_two_points(street):
    back = only(street, 1)
    x, y, z, yaw = pose_at(street, back, 12.3)
    assert (x, y, z) == pytest.approx((87.7, -1.75, 0.0))
    assert math.cos(yaw) == pytest.approx(-1.0)


def test_poses_and_widths_are_clamped_to_the_lane(street):
    ahead = only(street, -1)
    assert pose_at(street, ahead, -5.0)[0] == 0.0
    assert pose_at(street, ahead, 500.0)[0] == pytest.approx(100.0)
    assert width_at(street, ahead, -5.0) == pytest.approx(4.0)
    assert width_at(street, ahead, 500.0) == pytest.approx(3.0)


def test_width_changes_along_the_lane(street):
    assert width_at(street, only(street, -1), 25.0) == pytest.approx(3.75)


def test_a_point_to_the_right_has_a_positive_lateral(street):
    # The westbound driver's right is north, negative y.
    assert project_to_lane(street, only(street, 1), 40.0, -2.75) == pytest.approx((60.0, 1.0))
    assert project_to_lane(street, only(street, 1), 40.0, -0.75) == pytest.approx((60.0, -1.0))


def test_beyond_the_end_the_station_is_that_of_the_end(street):
    s, lateral = project_to_lane(street, only(street, 1), -7.0, -1.75)
    assert s == pytest.approx(100.0)
    assert lateral == pytest.approx(0.0)


def test_the_nearest_lane_is_found_with_its_station_and_distance(street):
    lane_, s, lateral, distance = nearest_lane(street, 30.0, -2.0, 0.0, 5.0, DRIVING_MASK)
    assert lane_ == only(street, 1)
    assert (s, lateral, distance) == pytest.approx((70.0, 0.25, 0.25))


def test_only_lanes_of_the_asked_kinds_count(street):
    beside = (30.0, 5.0, 0.0, 8.0)
    assert nearest_lane(street, *beside, sum(1 << int(kind) for kind in LaneKind))[0] == only(
        street, -2
    )
    assert nearest_lane(street, *beside, DRIVING_MASK)[0] == only(street, -1)
    assert nearest_lane(street, *beside, 1 << int(LaneKind.PARKING))[0] == -1


def test_lanes_out_of_reach_are_not_found(street):
    assert nearest_lane(street, 30.0, 30.0, 0.0, 5.0, DRIVING_MASK)[0] == -1
    assert nearest_lane(street, 30.0, 1e6, 0.0, 5.0, DRIVING_MASK)[0] == -1
    assert nearest_lane(street, 30.0, 30.0, 0.0, 40.0, DRIVING_MASK)[0] == only(street, -1)


def test_under_a_bridge_the_road_below_is_found_and_on_it_the_bridge(bridge):
    (below,) = np.flatnonzero(bridge.points[bridge.first, 2] == 0.0)
    (above,) = np.flatnonzero(bridge.points[bridge.first, 2] == 6.0)
    x, y = 51.75, 1.75  # where the two centre lines cross
    assert nearest_lane(bridge, x, y, 0.3, 5.0, DRIVING_MASK)[0] == below
    assert nearest_lane(bridge, x, y, 5.5, 5.0, DRIVING_MASK)[0] == above
    assert nearest_lane(bridge, x, y, 3.0, 5.0, DRIVING_MASK)[0] == -1  # 3 m from both


def test_a_lane_in_the_bodys_direction_goes_before_a_nearer_one(street):
    # 0.5 m from the westbound lane, 3 m from the eastbound one (4 m wide at first: y = 1.85).
    found = nearest_driving_lane_towards(street, 30.0, -1.25, 0.0, 0.2, 5.0)
    assert found[0] == only(street, -1)
    found = nearest_driving_lane_towards(street, 30.0, -1.25, 0.0, math.pi, 5.0)
    assert found[0] == only(street, 1)
    # Where there is none in that direction, the nearest of any is better than none.
    found = nearest_driving_lane_towards(street, 30.0, -4.0, 0.0, 0.2, 3.0)
    assert found[0] == only(street, 1)


def lanes_below(lanes, *box):
    out = np.empty(4, np.int32)
    count = lanes_below_box(lanes, *box, out)
    assert set(out[count:]) <= {-1}
    return list(out[:count])


def test_a_car_in_its_lane_lies_on_that_lane_alone(street):
    assert lanes_below(street, 30.0, -1.75, 0.0, math.pi, 2.4, 1.0) == [only(street, 1)]


def test_a_car_on_the_line_lies_on_both_lanes_the_nearer_first(street):
    assert lanes_below(street, 30.0, -0.4, 0.0, 0.0, 2.4, 1.0) == [
        only(street, 1),
        only(street, -1),
    ]


def test_a_turned_car_reaches_into_the_next_lane(street):
    # Turned by 90 degrees its 4.8 m lie across: from y = -4.15 to 0.65.
    both = [only(street, 1), only(street, -1)]
    assert lanes_below(street, 30.0, -1.75, 0.0, math.pi / 2, 2.4, 1.0) == both


def test_a_car_before_a_lanes_beginning_is_not_on_it(street):
    # The eastbound lane begins at x = 0. A nose at x = -0.6 is not there yet, one at 0.4 is.
    assert lanes_below(street, -3.0, 1.75, 0.0, 0.0, 2.4, 1.0) == []
    assert lanes_below(street, -2.0, 1.75, 0.0, 0.0, 2.4, 1.0) == [only(street, -1)]


@settings(deadline=None)
@given(
    x=st.floats(10.0, 90.0),
    y=st.floats(-8.0, 8.0),
    yaw=st.floats(-3.2, 3.2),
    half_length=st.floats(0.3, 3.0),
    half_width=st.floats(0.2, 1.2),
)
def test_a_box_is_on_a_straight_lane_when_its_reach_across_is(
    street, x, y, yaw, half_length, half_width
):
    reach = half_length * abs(math.sin(yaw)) + half_width * abs(math.cos(yaw))
    gap = abs(y + 1.75) - reach - 1.75  # to the westbound lane, 3.5 m wide
    found = only(street, 1) in lanes_below(street, x, y, 0.0, yaw, half_length, half_width)
    if abs(gap) > 0.02:  # a corner abreast of no point is seen a little late
        assert found == (gap < 0.0)


def test_a_car_under_a_bridge_is_not_on_it(bridge):
    found = lanes_below(bridge, 51.75, 1.75, 0.0, 0.0, 2.4, 1.0)
    assert [bridge.road[lane_] for lane_ in found] == [0]


def test_at_most_four_lanes_are_told(junction):
    found = lanes_below(junction, 0.0, 0.0, 0.0, 0.0, 6.0, 6.0)
    assert len(found) == 4
    assert len(set(found)) == 4
    # Eight ways cross there; the four inner ones pass 1.75 m from the middle, the others 5.25 m.
    for lane_ in found:
        assert abs(project_to_lane(junction, lane_, 0.0, 0.0)[1]) == pytest.approx(1.75)


def clear_distance(lanes, lane_, x, y):
    """Distance to a lane's polyline by looking at every segment."""
    first, count = lanes.first[lane_], lanes.count[lane_]
    a = lanes.points[first : first + count - 1, :2]
    b = lanes.points[first + 1 : first + count, :2]
    along = ((np.array([x, y]) - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1)
    foot = a + np.clip(along, 0.0, 1.0)[:, None] * (b - a)
    return float(np.hypot(foot[:, 0] - x, foot[:, 1] - y).min())


NEARBY = st.floats(-60.0, 60.0)


@settings(deadline=None)
@given(x=NEARBY, y=NEARBY, reach=st.floats(0.5, 40.0))
def test_no_lane_is_nearer_than_the_nearest(junction, x, y, reach):
    lane_, s, _, distance = nearest_lane(junction, x, y, 0.0, reach, DRIVING_MASK)
    distances = [clear_distance(junction, i, x, y) for i in range(len(junction.kind))]
    if lane_ < 0:
        assert min(distances) >= reach - 1e-9
    else:
        assert distance == pytest.approx(min(distances), abs=1e-9)
        px, py, _, _ = pose_at(junction, lane_, s)
        assert math.hypot(px - x, py - y) == pytest.approx(distance, abs=1e-6)


@settings(deadline=None)
@given(s=st.floats(0.0, 94.0), lateral=st.floats(-8.0, 8.0), error=st.floats(-10.0, 10.0))
def test_a_projection_gives_back_station_and_lateral(curve, s, lateral, error):
    x, y, _, yaw = pose_at(curve, 0, s)
    x, y = x - math.sin(yaw) * lateral, y + math.cos(yaw) * lateral
    for found in (
        project_to_lane(curve, 0, x, y),
        project_to_lane(curve, 0, x, y, min(max(s + error, 0.0), 94.0)),
    ):
        # The polyline has corners: at 8 m off a station is known to a point's turn, 8 m / 60.
        assert found[0] == pytest.approx(s, abs=0.15)
        assert found[1] == pytest.approx(lateral, abs=0.01)


def leaping(lanes, lane_, by_m):
    """The lanes, the further half of one lane by so many metres further to the east and north."""
    points = lanes.points.copy()
    own = slice(lanes.first[lane_], lanes.first[lane_] + lanes.count[lane_])
    points[own][lanes.count[lane_] // 2 :, :2] += by_m
    longest = lanes.longest_step_m.copy()
    longest[lane_] = np.hypot(*np.diff(points[own, :2], axis=0).T).max()
    return lanes._replace(points=points, longest_step_m=longest)


@settings(deadline=None, max_examples=300)
@given(
    x=st.floats(-150.0, 250.0),
    y=st.floats(-150.0, 150.0),
    leap=st.one_of(st.just(0.0), st.floats(-60.0, 60.0)),
)
def test_a_projection_is_onto_the_nearest_of_all_points_of_the_lane(curve, x, y, leap):
    lanes = leaping(curve, 0, leap)
    places = lanes.points[lanes.first[0] : lanes.first[0] + lanes.count[0], :2]
    dx, dy = places[:, 0] - x, places[:, 1] - y
    nearest = int(np.argmin(dx * dx + dy * dy))  # the first of several
    from_there = project_to_lane(lanes, 0, x, y, nearest * float(lanes.spacing_m[0]))
    assert project_to_lane(lanes, 0, x, y) == from_there


def test_of_two_points_as_near_the_first_is_the_nearest(curve):
    """The sixth and the thirty-third, where all others are 10 m away."""
    points = np.full_like(curve.points, 0.0)
    points[:, 0] = 10.0
    points[[5, 32], 0] = 0.0
    lanes = curve._replace(points=points, longest_step_m=np.array([10.0]))
    assert project_to_lane(lanes, 0, 0.0, 0.0)[0] == pytest.approx(5 * curve.spacing_m[0])


@pytest.fixture(scope="module")
def curve(tmp_path_factory):
    line = geometry(94.2, shape=f'<arc curvature="{1 / 60!r}"/>')
    narrow = '<width sOffset="0" a="0.0" b="0" c="0" d="0"/>'
    text = opendrive(road("1", 94.2, section(0.0, lane(-1, width=narrow)), line=line))
    return load(text, tmp_path_factory.mktemp("curve")).lanes
