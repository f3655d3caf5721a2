"""Lines and arcs: what they reach, and with which heading."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from di_envs.town.building.alignment import (
    Pose,
    curve_between,
    length_of,
    pose_at,
    rounded_polyline,
    wrapped,
)

headings = st.floats(-math.pi, math.pi)
metres = st.floats(2.0, 60.0)


def test_a_right_angle_of_ten_metres_radius_keeps_ten_metres_of_each_leg_of_twenty():
    curve = rounded_polyline([(0, 0, 0), (20, 0, 10), (20, 20, 0)])
    assert [piece.length_m for piece in curve] == pytest.approx([10.0, 5.0 * math.pi, 10.0])
    assert curve[1].curvature_per_m == pytest.approx(0.1)
    assert curve[-1].end == pytest.approx((20.0, 20.0, math.pi / 2))


def test_a_rounding_longer_than_its_leg_is_refused_with_the_corner_named():
    with pytest.raises(ValueError, match=r"corner 1 at \(20, 0\) needs 25.0 m of a leg of 20.0 m"):
        rounded_polyline([(0, 0, 0), (20, 0, 25), (20, 60, 0)])


def test_a_quarter_turn_between_equal_legs_is_one_arc():
    (arc,) = curve_between(Pose(0, 0, 0), Pose(8, -8, -math.pi / 2))
    assert arc.curvature_per_m == pytest.approx(-1 / 8)
    assert arc.length_m == pytest.approx(4.0 * math.pi)


def test_a_turn_whose_corner_lies_behind_is_refused():
    with pytest.raises(ValueError, match="no turn from"):
        curve_between(Pose(0, 0, 0), Pose(-5, 5, math.pi / 2))


@given(
    headings,
    metres,
    metres,
    st.floats(0.6, 2.4).flatmap(lambda a: st.sampled_from([a, -a])),
)
def test_a_turn_arrives_where_and_how_it_should_with_the_largest_radius(h, before, after, turn):
    start = Pose(3.0, -4.0, h)
    end = Pose(*start.shifted(before, 0.0)[:2], h + turn).shifted(after, 0.0)
    curve = curve_between(start, end)
    reached = curve[-1].end
    assert math.hypot(reached.x - end.x, reached.y - end.y) < 1e-6
    assert abs(wrapped(reached.heading - end.heading)) < 1e-9
    radius = min(before, after) / math.tan(abs(turn) / 2)
    assert max(abs(piece.curvature_per_m) for piece in curve) == pytest.approx(1 / radius)


@given(headings, st.floats(5.0, 60.0), st.floats(-1.5, 1.5), st.floats(-0.4, 0.4))
def test_a_swerve_arrives_where_and_how_it_should(h, ahead, left, turn):
    start = Pose(1.0, 2.0, h)
    end = Pose(*start.shifted(ahead, left)[:2], h + turn)
    reached = curve_between(start, end)[-1].end
    assert math.hypot(reached.x - end.x, reached.y - end.y) < 1e-4
    assert abs(wrapped(reached.heading - end.heading)) < 1e-4


@given(st.floats(0.0, 1.0))
def test_stations_measure_the_way_along_the_curve(share):
    curve = rounded_polyline([(0, 0, 0), (20, 0, 10), (20, 20, 0)])
    station = share * length_of(curve)
    pose = pose_at(curve, station)
    arc = 5.0 * math.pi
    expected = min(max((station - 10.0) / arc, 0.0), 1.0) * math.pi / 2
    assert pose.heading == pytest.approx(expected, abs=1e-9)
