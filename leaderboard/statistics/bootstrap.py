"""The bootstrap over whole clusters: how far a mean, or any statistic of sums, can be trusted.

What was measured on one route (other seeds, other moments, the same route under another id) rises
and falls together, so clusters are drawn, each with all that it has. The draws are a fixed stream
of SHAKE-256: equal values give the equal interval, on any machine, and statistics of equally many
clusters are resampled by the same draws.

Source: Efron, Tibshirani: An Introduction to the Bootstrap, 1993 (percentile interval); clusters as
in Cameron, Gelbach, Miller: Bootstrap-Based Improvements for Inference with Clustered Errors, 2008;
Hesterberg: What Teachers Should Know About the Bootstrap, The American Statistician 2015 (expanded
percentile interval).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leaderboard.statistics.confidence import t_quantile

Floats = NDArray[np.float64]

RESAMPLES = 10_000
TAIL = 0.025  # beyond each end of a 95 % interval
FEWEST_OF_MOMENTS = 3  # of fewer routes' moments no interval is given: it would say far too much
FEW_ROUTES = 10  # fewer distinct ones make an interval too narrow: tables say so
_STREAM = b"driveinsight compare"
_BYTES = 8


@dataclass(frozen=True, kw_only=True)
class BootstrapInterval:
    """A statistic with its percentile interval, whose ends are None for too few clusters.

    Attributes:
        value: Of all clusters as they are; NaN if it is of nothing.
        low: End of the interval.
        high: The other.
        clusters: How many distinct ones it rests on.
    """

    value: float
    low: float | None
    high: float | None
    clusters: int

    @property
    def clear(self) -> bool:
        """Whether the interval leaves no doubt about the sign."""
        return self.low is not None and self.high is not None and self.low * self.high > 0.0


def clustered_interval(
    differences: Sequence[float], clusters: Sequence[Hashable]
) -> BootstrapInterval:
    """The mean of the differences, with its 95 % interval.

    Args:
        differences: One a pair.
        clusters: To which cluster each pair belongs.

    Raises:
        ValueError: If there is no pair, or not a cluster for each.
    """
    mean = clustered_mean(differences, clusters)
    found = bootstrap_interval(pooled_mean, _sums_and_counts(differences, clusters))
    return replace(found, value=mean)


def clustered_mean(differences: Sequence[float], clusters: Sequence[Hashable]) -> float:
    """The mean of the differences.

    Raises:
        ValueError: If there is no pair, or not a cluster for each.
    """
    if not differences or len(differences) != len(clusters):
        raise ValueError("a mean difference needs at least one pair, and a cluster for each")
    return math.fsum(differences) / len(differences)


def resampled_means(
    differences: Sequence[float], clusters: Sequence[Hashable], resamples: int = RESAMPLES
) -> Floats | None:
    """What the mean would have been with other clusters, drawn with replacement.

    Args:
        differences: One a pair.
        clusters: To which cluster each pair belongs.
        resamples: How many means.

    Returns:
        (resamples,) means; None where there is but one cluster.
    """
    sums = _sums_and_counts(differences, clusters)
    return None if len(sums) < 2 else pooled_mean(resampled(sums, resamples))


def pooled_mean_interval(sums: Floats, tail: float = TAIL) -> BootstrapInterval:
    """The mean over all moments, from (C, 2) sum and count of each route's values."""
    return bootstrap_interval(
        pooled_mean, sums, present=sums[:, 1] > 0.0, tail=tail, fewest=FEWEST_OF_MOMENTS
    )


def pooled_ratio_interval(over: Floats, under: Floats, tail: float = TAIL) -> BootstrapInterval:
    """The ratio of two pooled means, such as inside a situation over outside of it.

    Args:
        over: (C, 2) sum and count of each route's values above the line.
        under: (C, 2) sum and count of those below it.
        tail: How probably the truth lies beyond each end.
    """

    def ratio(sums: Floats) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(pooled_mean(sums[..., :2]) / pooled_mean(sums[..., 2:]))

    present = (over[:, 1] > 0.0) & (under[:, 1] > 0.0)
    sums = np.concatenate([over, under], axis=1)
    return bootstrap_interval(ratio, sums, present=present, tail=tail, fewest=FEWEST_OF_MOMENTS)


def pooled_mean(sums: Floats) -> Floats:
    """(...) means of (..., 2) sums and counts; NaN of nothing."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(sums[..., 0] / sums[..., 1])


def bootstrap_interval(
    statistic: Callable[[Floats], Floats],
    sums: Floats,
    *,
    present: NDArray[np.bool_] | None = None,
    tail: float = TAIL,
    fewest: int = 2,
) -> BootstrapInterval:
    """A statistic of sums over clusters, with its percentile interval.

    Args:
        statistic: Of (..., K) sums to (...) numbers.
        sums: (C, K) of each cluster.
        present: (C,) which of them have what the statistic is of; None for all.
        tail: How probably the truth lies beyond each end.
        fewest: Clusters that have it, for an interval to be given.
    """
    count = len(sums) if present is None else int(present.sum())
    value = float(statistic(sums.sum(axis=0)))
    if count < fewest:
        return BootstrapInterval(value=value, low=None, high=None, clusters=count)
    found = statistic(resampled(sums))
    found = found[np.isfinite(found)]  # draws of clusters that have nothing of it say nothing
    low, high = np.quantile(found, [tail, 1.0 - tail])
    return BootstrapInterval(value=value, low=float(low), high=float(high), clusters=count)


def expanded_interval(means: Floats, clusters: int, tail: float) -> tuple[float, float]:
    """The expanded percentile interval.

    A bootstrap of n values spreads as if divided by n, not n - 1, and knows of no Student's t: the
    percentiles are taken further out by both.

    Args:
        means: Resampled ones.
        clusters: How many distinct ones were resampled, 2 or more.
        tail: How probably the truth lies beyond each end.
    """
    wider = math.sqrt(clusters / (clusters - 1)) * t_quantile(clusters - 1, 1.0 - tail)
    share = NormalDist().cdf(-wider)
    low, high = np.quantile(means, [share, 1.0 - share])
    return float(low), float(high)


def cluster_sums(values: ArrayLike, clusters: Sequence[Hashable]) -> Floats:
    """(C, ...) sums of (N, ...) values over each distinct cluster, in the order of the first."""
    each = np.asarray(values, np.float64)
    index = {name: number for number, name in enumerate(dict.fromkeys(clusters))}
    sums = np.zeros((len(index), *each.shape[1:]))
    np.add.at(sums, [index[cluster] for cluster in clusters], each)
    return sums


def _sums_and_counts(values: Sequence[float], clusters: Sequence[Hashable]) -> Floats:
    return cluster_sums([(value, 1.0) for value in values], clusters)


def resampled(sums: Floats, resamples: int = RESAMPLES) -> Floats:
    """(resamples, K) sums over as many clusters, drawn with replacement from (C, K)."""
    drawn = draws(resamples, len(sums))
    return np.stack([column[drawn].sum(axis=1) for column in sums.T], axis=-1)


@lru_cache(maxsize=2)
def draws(resamples: int, clusters: int) -> NDArray[np.intp]:
    """(resamples, clusters) which clusters are drawn; the same ones for all that have so many."""
    stream = hashlib.shake_256(_STREAM).digest(resamples * clusters * _BYTES)
    drawn = np.frombuffer(stream, "<u8") % clusters
    return drawn.astype(np.intp).reshape(resamples, clusters)
