"""The clustered bootstrap, where its answer is known."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis.strategies import floats, lists

from leaderboard.statistics.bootstrap import clustered_interval


def test_equal_differences_leave_no_doubt():
    interval = clustered_interval([2.0] * 6, "abcdef")
    assert (interval.mean, interval.low, interval.high) == (2.0, 2.0, 2.0)
    assert interval.clear


def test_one_route_has_no_interval_however_many_seeds():
    interval = clustered_interval([1.0, 2.0, 3.0], ["a", "a", "a"])
    assert (interval.mean, interval.low, interval.high) == (2.0, None, None)
    assert not interval.clear


def test_two_clusters_of_nought_and_ten_give_all_of_the_range():
    """A resample is both 0 (a quarter), both 10 (a quarter), or one of each."""
    interval = clustered_interval([0.0, 10.0], ["a", "b"])
    assert (interval.mean, interval.low, interval.high) == (5.0, 0.0, 10.0)
    assert not interval.clear


def test_for_many_routes_it_is_the_normal_interval():
    """400 clusters, half 0 and half 2: deviation 1, so the mean's is 1 / 20."""
    interval = clustered_interval([0.0, 2.0] * 200, range(400))
    assert interval.low == pytest.approx(1.0 - 1.96 / 20.0, abs=0.01)
    assert interval.high == pytest.approx(1.0 + 1.96 / 20.0, abs=0.01)


def test_seeds_of_one_route_do_not_narrow_the_interval():
    few = clustered_interval([0.0, 2.0, 0.0, 2.0], "abcd")
    many = clustered_interval([0.0, 2.0, 0.0, 2.0] * 10, list("abcd") * 10)
    assert (few.low, few.high) == (many.low, many.high)


@given(lists(floats(-100.0, 100.0), min_size=2, max_size=12))
def test_equal_pairs_give_the_equal_interval_around_the_mean(differences):
    one = clustered_interval(differences, range(len(differences)))
    assert one == clustered_interval(differences, range(len(differences)))
    assert one.low is not None
    assert one.high is not None
    assert min(differences) - 1e-9 <= one.low <= one.high <= max(differences) + 1e-9
    assert math.isclose(one.mean, math.fsum(differences) / len(differences), abs_tol=1e-12)


def test_no_pairs_are_refused():
    with pytest.raises(ValueError, match="at least one pair"):
        clustered_interval([], [])
