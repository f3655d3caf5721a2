"""What a row of a study changed, how surely, and which verdict that allows.

A pair is one world driven with the edit and without it. Differences are means over pairs; their
doubt comes from resampling distinct routes, each with all its seeds. A world is a function of seed
and route, so seeds are nested in routes, and whole routes carry the doubt of both.

Intervals are Bonferroni's over the rows of the study: all of them hold together with 95 %. (Holm's
tests would find a little more, but have no intervals that agree with their verdicts; here a verdict
can be read off the interval that is drawn.) They are percentile intervals, widened for few routes.

A row "matters" if its interval excludes 0. It is "equivalent" if the interval of two one-sided
tests lies within the margin; that comes first, as a sure difference that is so small is of no
importance. Otherwise it is "undecided".

Source: Schuirmann: A Comparison of the Two One-Sided Tests Procedure, Journal of Pharmacokinetics
and Biopharmaceutics 1987; Dunn: Multiple Comparisons Among Means, JASA 1961.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from leaderboard.statistics.bootstrap import clustered_mean, expanded_interval, resampled_means
from leaderboard.statistics.confidence import t_quantile

MARGIN_DS = 5.0  # a smaller difference of driving scores is of no importance
ALPHA = 0.05  # of all rows together
POWER = 0.8  # with which the smallest effect would have been seen
RESAMPLES = 50_000  # far tails are asked for
MATTERS, EQUIVALENT, UNDECIDED = "matters", "equivalent", "undecided"


@dataclass(frozen=True, kw_only=True)
class Effect:
    """A mean paired difference and what can be said of it.

    Attributes:
        mean: Of the differences, edited less unedited.
        low: Of the interval that holds together with those of all rows; None for one route.
        high: Its other end.
        inner_low: Of the two one-sided tests: an interval of twice the error.
        inner_high: Its other end.
        margin: Within which differences are of no importance.
        smallest: The effect that would have been called clear with a probability of `POWER`; None
            where nothing varied, so that nothing is known of how much it does.
        pairs: How many.
        routes: How many distinct ones.
        means: (RESAMPLES,) resampled means; None for one route.
    """

    mean: float
    low: float | None
    high: float | None
    inner_low: float | None
    inner_high: float | None
    margin: float
    smallest: float | None
    pairs: int
    routes: int
    means: NDArray[np.float64] | None = field(repr=False, compare=False)

    @property
    def clear(self) -> bool:
        """Whether the interval excludes 0."""
        return self.low is not None and self.high is not None and self.low * self.high > 0.0

    @property
    def verdict(self) -> str:
        """`matters`, `equivalent` or `undecided`."""
        if self.inner_low is not None and self.inner_high is not None:
            if -self.margin < self.inner_low and self.inner_high < self.margin:
                return EQUIVALENT
        return MATTERS if self.clear else UNDECIDED


def effect(
    differences: Sequence[float],
    routes: Sequence[str],
    *,
    tests: int = 1,
    margin: float = MARGIN_DS,
    alpha: float = ALPHA,
) -> Effect:
    """The effect that paired differences show.

    Args:
        differences: One a pair, edited less unedited.
        routes: Of each pair; equal for equal routes.
        tests: How many effects are looked at together.
        margin: Of equivalence.
        alpha: How probably one of all the intervals is wrong.

    Raises:
        ValueError: If there is no pair, or not a route for each.
    """
    mean = clustered_mean(differences, routes)
    means = resampled_means(differences, routes, RESAMPLES)
    count = len(set(routes))
    outer: tuple[float | None, float | None] = (None, None)
    inner = outer
    smallest = None
    if means is not None:
        outer = expanded_interval(means, count, alpha / tests / 2.0)
        inner = expanded_interval(means, count, alpha / tests)
        smallest = _smallest(means, count, alpha / tests)
    return Effect(
        mean=mean,
        low=outer[0],
        high=outer[1],
        inner_low=inner[0],
        inner_high=inner[1],
        margin=margin,
        smallest=smallest,
        pairs=len(differences),
        routes=count,
        means=means,
    )


def share_effect(
    shares: Sequence[float],
    routes: Sequence[str],
    *,
    least: float = 0.0,
    tests: int = 1,
    margin: float = MARGIN_DS,
    alpha: float = ALPHA,
) -> Effect:
    """As `effect`, of values up to 1 that are often all the same.

    Of what was the same on n routes a bootstrap says that it always is. Here the interval then
    reaches as far as chance could still have hidden it, up to a share p with (1 - p)^n = tail.

    Args:
        least: The least that a value can be: 0 for shares, -1 for differences of them.

    Source: Clopper, Pearson: The Use of Confidence or Fiducial Limits, Biometrika 1934.
    """
    found = effect(shares, routes, tests=tests, margin=margin, alpha=alpha)
    if found.means is None or float(np.ptp(found.means)) > 0.0:
        return found

    def reach(tail: float) -> tuple[float, float]:
        hidden = 1.0 - tail ** (1.0 / found.routes)
        return max(found.mean - hidden, least), min(found.mean + hidden, 1.0)

    low, high = reach(alpha / tests / 2.0)
    inner_low, inner_high = reach(alpha / tests)
    return replace(found, low=low, high=high, inner_low=inner_low, inner_high=inner_high)


def _smallest(means: NDArray[np.float64], routes: int, alpha: float) -> float | None:
    error = float(means.std()) * math.sqrt(routes / (routes - 1))
    if error == 0.0:
        return None
    degrees = routes - 1
    return error * (t_quantile(degrees, 1.0 - alpha / 2.0) + t_quantile(degrees, POWER))
