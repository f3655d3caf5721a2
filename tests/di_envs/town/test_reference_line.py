"""The five shapes against closed forms and plain numerical integration."""

from __future__ import annotations

import bisect
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from di_envs.town.reading.records import GeometryRecord
from di_envs.town.reading.reference_line import Breakpoints, Cubics, ReferenceLines


def evaluate(shape, parameters, length, stations, x=0.0, y=0.0, heading=0.0):
    piece = GeometryRecord(
        shape=shape, begin=0.0, length=length, x=x, y=y, heading=heading, parameters=parameters
    )
    stations = np.asarray(stations, dtype=float)
    return np.stack(ReferenceLines([[piece]])(np.zeros(len(stations), dtype=int), stations), axis=1)


def integrate_clothoid(start, end, length, station, steps=20_000):
    """Position by the midpoint rule: heading of a curvature that changes linearly."""
    t = (np.arange(steps) + 0.5) * station / steps
    heading = start * t + 0.5 * (end - start) / length * t * t
    return np.cos(heading).sum() * station / steps, np.sin(heading).sum() * station / steps


def test_a_line_runs_along_its_heading():
    x, y, heading, curvature = evaluate("line", (), 10.0, [4.0], x=1.0, y=2.0, heading=math.pi / 2)[
        0
    ]
    assert (x, y, heading, curvature) == pytest.approx((1.0, 6.0, math.pi / 2, 0.0))


def test_a_quarter_circle_of_ten_metres_ends_ten_ahead_and_ten_to_the_left():
    quarter = 10.0 * math.pi / 2
    assert evaluate("arc", (0.1,), quarter, [quarter])[0] == pytest.approx(
        (10.0, 10.0, math.pi / 2, 0.1)
    )


def test_an_arc_of_no_curvature_is_a_line():
    assert evaluate("arc", (0.0,), 8.0, [5.0])[0] == pytest.approx((5.0, 0.0, 0.0, 0.0))


@given(curvature=st.floats(-0.2, 0.2), station=st.floats(0.0, 50.0))
def test_a_spiral_of_constant_curvature_is_an_arc(curvature, station):
    spiral = evaluate("spiral", (curvature, curvature), 50.0, [station])[0]
    assert spiral == pytest.approx(evaluate("arc", (curvature,), 50.0, [station])[0], abs=1e-9)


@given(
    start=st.floats(-0.2, 0.2),
    end=st.floats(-0.2, 0.2),
    length=st.floats(1.0, 100.0),
    share=st.floats(0.01, 1.0),
)
def test_a_spiral_is_the_integral_of_its_heading(start, end, length, share):
    station = share * length
    x, y, heading, curvature = evaluate("spiral", (start, end), length, [station])[0]
    assert (x, y) == pytest.approx(integrate_clothoid(start, end, length, station), abs=1e-5)
    assert curvature == pytest.approx(start + (end - start) * share, abs=1e-12)
    assert heading == pytest.approx(0.5 * (start + curvature) * station, abs=1e-9)


def test_a_parabola_is_measured_along_its_arc():
    # v = u² / 20: arc length to u = 10 is 5 (sqrt(2) + asinh(1)), its slope there is 1.
    arc = 5.0 * (math.sqrt(2.0) + math.asinh(1.0))
    x, y, heading, curvature = evaluate("poly3", (0.0, 0.0, 0.05, 0.0), arc, [arc])[0]
    assert (x, y) == pytest.approx((10.0, 5.0), abs=1e-4)
    assert heading == pytest.approx(math.pi / 4, abs=1e-5)
    assert curvature == pytest.approx(0.1 / 2.0**1.5, abs=1e-6)


# Cubic Bézier of a quarter circle of radius 10 (handles 0.5523 of it): within 0.03 % of the circle.
_HANDLE = 10.0 * 4.0 / 3.0 * (math.sqrt(2.0) - 1.0)
_QUARTER_U = (0.0, 3.0 * _HANDLE, 30.0 - 6.0 * _HANDLE, 3.0 * _HANDLE - 20.0)
_QUARTER_V = (0.0, 0.0, 30.0 - 3.0 * _HANDLE, 3.0 * _HANDLE - 20.0)


@pytest.mark.parametrize("by_length", [False, True])
def test_a_parametric_cubic_follows_the_circle_that_it_approximates(by_length):
    length = 10.0 * math.pi / 2
    scale = length if by_length else 1.0  # the parameter runs to the length, or to 1
    u = [c / scale**k for k, c in enumerate(_QUARTER_U)]
    v = [c / scale**k for k, c in enumerate(_QUARTER_V)]
    stations = np.linspace(0.0, length, 33)
    points = evaluate("paramPoly3", (*u, *v, float(by_length)), length, stations)
    circle = evaluate("arc", (0.1,), length, stations)
    assert np.abs(points[:, :2] - circle[:, :2]).max() < 0.005
    assert np.abs(points[:, 2] - circle[:, 2]).max() < 0.005
    assert np.hypot(points[:, 0], points[:, 1] - 10.0) == pytest.approx(10.0, abs=0.003)


def test_beyond_its_end_a_line_stays_at_its_end():
    assert evaluate("line", (), 10.0, [12.0])[0, 0] == 10.0


def test_pieces_follow_each_other_and_roads_do_not_mix():
    def line(begin, x):
        return GeometryRecord(
            shape="line", begin=begin, length=10.0, x=x, y=0.0, heading=0.0, parameters=()
        )

    lines = ReferenceLines([[line(0.0, 0.0), line(10.0, 100.0)], [line(0.0, 1000.0)]])
    x = lines(np.array([0, 0, 1]), np.array([9.0, 11.0, 9.0]))[0]
    assert list(x) == [9.0, 101.0, 1009.0]


MICROMETRES = st.integers(-1_000_000, 1_000_000_000).map(lambda um: um / 1e6)


@given(
    owners=st.lists(st.lists(MICROMETRES, min_size=1, max_size=5), min_size=1, max_size=4),
    station=MICROMETRES,
)
def test_a_station_is_found_in_its_owners_own_pieces(owners, station):
    owners = [sorted(own) for own in owners]
    found = Breakpoints([np.array(own) for own in owners]).find(
        np.arange(len(owners)), np.full(len(owners), station)
    )
    first = 0
    for own, index in zip(owners, found, strict=True):
        assert index - first == max(bisect.bisect_right(own, station) - 1, 0)
        first += len(own)


def test_a_cubic_gives_its_value_and_slope():
    cubics = Cubics([np.array([[0.0, 1.0, 0.0, 0.0, 0.0], [2.0, 1.0, 2.0, 3.0, 4.0]])])
    value, slope = cubics(np.array([0, 0]), np.array([1.0, 3.0]))
    assert list(value) == [1.0, 10.0]
    assert list(slope) == [0.0, 20.0]  # 2 + 2*3 + 3*4
