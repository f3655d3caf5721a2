"""How far a statistic over routes can be trusted: the bootstrap over whole routes, for any of them.

Moments of one drive are not independent, so routes are drawn, each with all its moments. A draw is
a weight for each route, how often it was drawn; statistics are written as functions of such
weights, and so are worked out for all draws at once. The draws are a fixed stream of SHAKE-256.

Source: Efron, Tibshirani: An Introduction to the Bootstrap, 1993 (percentile interval).
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

RESAMPLES = 10_000
FEWEST = 3  # of fewer routes no interval is given: it would say far too much
_STREAM = b"driveinsight responses"
_BYTES = 8


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A statistic and its interval, whose ends are None where there are too few routes.

    Attributes:
        value: Over all routes as they are; NaN if it is of nothing.
        low: End of the interval.
        high: The other.
        routes: Distinct routes that it rests on.
    """

    value: float
    low: float | None
    high: float | None
    routes: int


def clustered(values: Floats, clusters: Sequence[Hashable]) -> Floats:
    """(C, ...) sums of (D, ...) values of drives over those of each distinct route."""
    names = list(dict.fromkeys(clusters))
    sums = np.zeros((len(names), *values.shape[1:]))
    np.add.at(sums, [names.index(cluster) for cluster in clusters], values)
    return sums


def ratio_interval(over: Floats, under: Floats, level: float = 0.95) -> Interval:
    """The ratio of two pooled means, such as inside a situation over outside of it.

    Args:
        over: (C, 2) sum and count of each route's values above the line.
        under: (C, 2) sum and count of those below it.
        level: Of the interval.
    """

    def statistic(weights: Floats) -> Floats:
        above, below = weights @ over, weights @ under
        with np.errstate(divide="ignore", invalid="ignore"):
            return (above[:, 0] / above[:, 1]) / (below[:, 0] / below[:, 1])

    return interval_of(statistic, (over[:, 1] > 0.0) & (under[:, 1] > 0.0), level)


def mean_interval(sums: Floats, level: float = 0.95) -> Interval:
    """A pooled mean of (C, 2) sum and count of each route's values."""

    def statistic(weights: Floats) -> Floats:
        total = weights @ sums
        with np.errstate(divide="ignore", invalid="ignore"):
            return total[:, 0] / total[:, 1]

    return interval_of(statistic, sums[:, 1] > 0.0, level)


def interval_of(
    statistic: Callable[[Floats], Floats], present: NDArray[np.bool_], level: float
) -> Interval:
    """A statistic with its percentile interval.

    Args:
        statistic: Of (R, C) weights of the routes to (R,) numbers.
        present: (C,) the routes that have what it is of.
        level: Of the interval.
    """
    count = int(present.sum())
    whole = statistic(np.ones((1, present.size)))[0]
    if count < FEWEST:
        return Interval(value=float(whole), low=None, high=None, routes=count)
    drawn = statistic(draws(present.size))
    drawn = drawn[np.isfinite(drawn)]  # draws of routes that have nothing of it say nothing
    tail = (1.0 - level) / 2.0
    low, high = np.quantile(drawn, [tail, 1.0 - tail])
    return Interval(value=float(whole), low=float(low), high=float(high), routes=count)


def draws(count: int) -> Floats:
    """(R, C) how often each of `count` routes was drawn, for every draw."""
    stream = hashlib.shake_256(_STREAM).digest(RESAMPLES * count * _BYTES)
    drawn = (np.frombuffer(stream, "<u8") % count).astype(np.int64).reshape(RESAMPLES, count)
    places = drawn + np.arange(RESAMPLES)[:, None] * count
    counts = np.bincount(places.reshape(-1), minlength=RESAMPLES * count)
    return counts.reshape(RESAMPLES, count).astype(np.float64)
