"""Intervals over routes: by arithmetic where it can be done, and what too few routes give."""

from __future__ import annotations

import numpy as np
import pytest

from leaderboard.statistics.resampling import clustered, draws, mean_interval, ratio_interval


def test_each_draw_takes_as_many_routes_as_there_are():
    weights = draws(7)
    assert (weights.sum(axis=1) == 7.0).all()
    assert weights.mean(axis=0) == pytest.approx(np.ones(7), abs=0.05)


def test_drives_of_one_route_are_drawn_together():
    values = np.array([[1.0, 1.0], [2.0, 1.0], [10.0, 5.0]])
    assert clustered(values, ["a", "b", "a"]).tolist() == [[11.0, 6.0], [2.0, 1.0]]


def test_a_pooled_mean_of_equal_routes_has_no_width():
    interval = mean_interval(np.array([[6.0, 3.0]] * 4))
    assert (interval.value, interval.low, interval.high, interval.routes) == (2.0, 2.0, 2.0, 4)


def test_the_interval_of_three_routes_goes_from_the_least_to_the_most():
    """All three draws the same has a chance of 1 in 27, 3.7 %: more than 2.5 %."""
    interval = mean_interval(np.array([[0.0, 1.0], [3.0, 1.0], [9.0, 1.0]]))
    assert (interval.value, interval.low, interval.high) == (4.0, 0.0, 9.0)


def test_a_ratio_is_of_pooled_means():
    over, under = np.array([[8.0, 2.0]] * 3), np.array([[6.0, 3.0]] * 3)
    assert ratio_interval(over, under).value == 2.0


def test_routes_without_the_situation_do_not_count():
    over = np.array([[8.0, 2.0], [8.0, 2.0], [0.0, 0.0], [0.0, 0.0]])
    interval = ratio_interval(over, np.array([[6.0, 3.0]] * 4))
    assert (interval.routes, interval.low, interval.high) == (2, None, None)


def test_the_same_routes_give_the_same_interval():
    sums = np.array([[float(n), 1.0] for n in range(9)])
    assert mean_interval(sums) == mean_interval(sums)
