"""Confidence intervals against printed tables of Student's t."""

from __future__ import annotations

import math

import pytest

from leaderboard.statistics.confidence import mean_interval, t_quantile


def test_the_interval_of_1_2_3_is_4_303_standard_errors_wide():
    interval = mean_interval([1.0, 2.0, 3.0])  # standard deviation 1
    assert interval.mean == 2.0
    assert interval.half_width == pytest.approx(4.302653 / math.sqrt(3.0))
    assert str(interval) == "2.0 ± 2.5"


def test_one_value_has_no_interval_and_says_so():
    interval = mean_interval([95.0])
    assert interval.half_width is None
    assert str(interval) == "95.0"


@pytest.mark.parametrize(
    ("degrees", "printed"), [(1, 12.706), (10, 2.228), (11, 2.201), (30, 2.042), (120, 1.980)]
)
def test_quantiles_are_those_of_the_printed_tables(degrees, printed):
    assert t_quantile(degrees) == pytest.approx(printed, abs=6e-4)


def test_no_values_are_refused():
    with pytest.raises(ValueError, match="at least one"):
        mean_interval([])


def test_quantiles_are_scipys():
    stats = pytest.importorskip("scipy.stats")
    for degrees in (1, 2, 3, 8, 26, 99):
        for probability in (0.5, 0.8, 0.975, 0.9988, 0.99999):
            theirs = stats.t.ppf(probability, degrees)
            assert t_quantile(degrees, probability) == pytest.approx(theirs, rel=1e-6, abs=1e-9)
