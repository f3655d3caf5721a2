"""The clustered bootstrap, where its answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats, lists

from leaderboard.statistics.bootstrap import (
    cluster_sums,
    clustered_interval,
    draws,
    pooled_mean_interval,
    pooled_ratio_interval,
    resampled_means,
)

FIRST_DRAW = [1, 2, 3, 0, 1, 5, 0]


def test_equal_differences_leave_no_doubt():
    interval = clustered_interval([2.0] * 6, "abcdef")
    assert (interval.value, interval.low, interval.high) == (2.0, 2.0, 2.0)
    assert interval.clear


def test_one_route_has_no_interval_however_many_seeds():
    interval = clustered_interval([1.0, 2.0, 3.0], ["a", "a", "a"])
    assert (interval.value, interval.low, interval.high) == (2.0, None, None)
    assert not interval.clear


def test_two_clusters_of_nought_and_ten_give_all_of_the_range():
    """A resample is both 0 (a quarter), both 10 (a quarter), or one of each."""
    interval = clustered_interval([0.0, 10.0], ["a", "b"])
    assert (interval.value, interval.low, interval.high) == (5.0, 0.0, 10.0)
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
    assert math.isclose(one.value, math.fsum(differences) / len(differences), abs_tol=1e-12)


def test_no_pairs_are_refused():
    with pytest.raises(ValueError, match="at least one pair"):
        clustered_interval([], [])


def test_each_draw_takes_as_many_clusters_as_there_are_each_as_likely():
    drawn = draws(10_000, 7)
    assert drawn.shape == (10_000, 7)
    assert np.bincount(drawn.ravel(), minlength=7) / 10_000 == pytest.approx(np.ones(7), abs=0.05)


def test_the_draws_are_those_that_earlier_comparisons_were_made_with():
    assert draws(10_000, 7)[0].tolist() == FIRST_DRAW
    means = resampled_means([1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0], range(7))
    assert means[0] == sum(2.0**cluster for cluster in FIRST_DRAW) / 7.0


def test_drives_of_one_route_are_drawn_together():
    values = np.array([[1.0, 1.0], [2.0, 1.0], [10.0, 5.0]])
    assert cluster_sums(values, ["a", "b", "a"]).tolist() == [[11.0, 6.0], [2.0, 1.0]]


def test_a_pooled_mean_of_equal_routes_has_no_width():
    interval = pooled_mean_interval(np.array([[6.0, 3.0]] * 4))
    assert (interval.value, interval.low, interval.high) == (2.0, 2.0, 2.0)
    assert interval.clusters == 4


def test_the_interval_of_three_routes_goes_from_the_least_to_the_most():
    """All three draws the same has a chance of 1 in 27, 3.7 %: more than 2.5 %."""
    interval = pooled_mean_interval(np.array([[0.0, 1.0], [3.0, 1.0], [9.0, 1.0]]))
    assert (interval.value, interval.low, interval.high) == (4.0, 0.0, 9.0)


def test_a_ratio_is_of_pooled_means():
    over, under = np.array([[8.0, 2.0]] * 3), np.array([[6.0, 3.0]] * 3)
    assert pooled_ratio_interval(over, under).value == 2.0


def test_routes_without_the_situation_do_not_count():
    over = np.array([[8.0, 2.0], [8.0, 2.0], [0.0, 0.0], [0.0, 0.0]])
    interval = pooled_ratio_interval(over, np.array([[6.0, 3.0]] * 4))
    assert (interval.clusters, interval.low, interval.high) == (2, None, None)


def test_the_same_routes_give_the_same_interval():
    sums = np.array([[float(n), 1.0] for n in range(9)])
    assert pooled_mean_interval(sums) == pooled_mean_interval(sums)


def test_a_pooled_mean_and_a_mean_of_pairs_are_of_one_engine():
    """They had a stream each: the same routes had two intervals."""
    values = [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0]
    pooled = pooled_mean_interval(np.array([[value, 1.0] for value in values]))
    paired = clustered_interval(values, range(8))
    assert (pooled.low, pooled.high) == (paired.low, paired.high)
