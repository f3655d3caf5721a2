"""Effects and verdicts where a person can work them out."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats, integers, lists

from leaderboard.statistics.confidence import t_quantile
from leaderboard.studies.effects import (
    EQUIVALENT,
    MATTERS,
    UNDECIDED,
    effect,
    share_effect,
)

HUNDRED = [str(number) for number in range(100)]


def test_without_any_difference_nothing_matters_and_no_smallest_effect_is_known():
    found = effect([0.0] * 10, list("abcdefghij"))
    assert (found.mean, found.low, found.high) == (0.0, 0.0, 0.0)
    assert found.verdict == EQUIVALENT
    assert found.smallest is None
    assert not found.clear


def test_one_route_decides_nothing():
    found = effect([-80.0, -80.0], ["a", "a"])
    assert (found.mean, found.low, found.verdict) == (-80.0, None, UNDECIDED)


def test_a_sure_large_fall_matters_and_a_sure_small_one_is_equivalent_though_not_0():
    assert effect([-40.0, -42.0] * 50, HUNDRED).verdict == MATTERS
    small = effect([-1.0, -2.0] * 50, HUNDRED)
    assert small.verdict == EQUIVALENT
    assert small.clear


def test_an_interval_that_reaches_past_the_margin_and_0_is_undecided():
    """Ten routes, nine unchanged and one that lost all: mean -10, error 10."""
    found = effect([-100.0, *[0.0] * 9], list("abcdefghij"))
    assert found.verdict == UNDECIDED
    assert found.high == 0.0


def test_for_many_routes_the_interval_is_students_around_the_mean():
    """100 routes, half 0 and half 10: deviation 5 (n) or 5 * sqrt(100 / 99) (n - 1)."""
    found = effect([0.0, 10.0] * 50, HUNDRED)
    error = 5.0 * math.sqrt(100.0 / 99.0) / 10.0
    half = t_quantile(99) * error
    assert (found.mean, found.routes, found.pairs) == (5.0, 100, 100)
    assert found.low == pytest.approx(5.0 - half, abs=0.06)
    assert found.high == pytest.approx(5.0 + half, abs=0.06)
    inner = t_quantile(99, 0.95) * error
    assert found.inner_low == pytest.approx(5.0 - inner, abs=0.06)
    # what would be clear with 80 %: the quantiles of both errors, added
    assert found.smallest == pytest.approx(half + t_quantile(99, 0.8) * error, rel=0.01)


def test_twenty_rows_are_judged_at_a_twentieth_of_the_error():
    found = effect([0.0, 10.0] * 50, HUNDRED, tests=20)
    error = 5.0 * math.sqrt(100.0 / 99.0) / 10.0
    assert found.high == pytest.approx(5.0 + t_quantile(99, 1.0 - 0.05 / 40.0) * error, abs=0.15)
    assert found.verdict == MATTERS  # 5 - 3.2 * 0.5 is above 0


def test_the_margin_is_asked_for_by_two_one_sided_tests():
    """Mean 4, error 0.5: 4 + 1.66 * 0.5 = 4.83 is within 5, 4 + 1.98 * 0.5 = 4.99 nearly not."""
    found = effect([-1.0, 9.0] * 50, HUNDRED)
    assert found.inner_high == pytest.approx(4.83, abs=0.06)
    assert found.verdict == EQUIVALENT
    assert effect([-0.5, 9.5] * 50, HUNDRED).verdict == MATTERS  # 5.33, and clear of 0


def test_what_never_happened_on_ten_routes_may_still_happen_on_a_quarter():
    """(1 - p)^10 = 0.05 at p = 0.259, and 0.025 at p = 0.308."""
    never = share_effect([0.0] * 10, list("abcdefghij"))
    assert (never.low, never.inner_low) == (0.0, 0.0)
    assert never.inner_high == pytest.approx(0.2589, abs=1e-4)
    assert never.high == pytest.approx(0.3085, abs=1e-4)
    always = share_effect([1.0] * 10, list("abcdefghij"))
    assert (always.low, always.high) == (pytest.approx(0.6915, abs=1e-4), 1.0)
    same = share_effect([0.0] * 10, list("abcdefghij"), least=-1.0)
    assert same.low == pytest.approx(-0.3085, abs=1e-4)
    varied = [0.0, 1.0] * 5
    assert share_effect(varied, list("abcdefghij")) == effect(varied, list("abcdefghij"))


def test_the_same_route_twice_is_one_route():
    twice = effect([1.0, 1.0, 5.0, 5.0, 3.0, 3.0], list("aabbcc"))
    once = effect([1.0, 5.0, 3.0], list("abc"))
    assert (twice.low, twice.high, twice.routes) == (once.low, once.high, 3)


@settings(deadline=None, max_examples=25)
@given(lists(floats(-100.0, 100.0), min_size=2, max_size=8), integers(1, 30))
def test_more_rows_widen_the_interval_and_never_make_a_verdict_surer(differences, tests):
    routes = [str(number) for number in range(len(differences))]
    alone, among = effect(differences, routes), effect(differences, routes, tests=tests)
    assert among.low <= alone.low <= alone.inner_low + 1e-9
    assert among.high >= alone.high >= alone.inner_high - 1e-9
    if alone.verdict == UNDECIDED:
        assert among.verdict == UNDECIDED
