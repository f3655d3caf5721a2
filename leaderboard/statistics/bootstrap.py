"""The confidence of a mean difference, by resampling whole routes.

Pairs of one route (other seeds, or the same route under another id) rise and fall together, so
clusters are drawn, each with all its pairs. The draws are a fixed stream of SHAKE-256: equal pairs
give the equal interval, on any machine.

Source: Efron, Tibshirani: An Introduction to the Bootstrap, 1993 (percentile interval); clusters as
in Cameron, Gelbach, Miller: Bootstrap-Based Improvements for Inference with Clustered Errors, 2008.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

RESAMPLES = 10_000
_STREAM = b"driveinsight compare"
_BYTES = 8


@dataclass(frozen=True, kw_only=True)
class DifferenceInterval:
    """A mean difference with its 95 % interval, None where there is but one cluster."""

    mean: float
    low: float | None
    high: float | None

    @property
    def clear(self) -> bool:
        """Whether the interval leaves no doubt about the sign."""
        return self.low is not None and self.high is not None and self.low * self.high > 0.0


def clustered_interval(
    differences: Sequence[float], clusters: Sequence[Hashable]
) -> DifferenceInterval:
    """The mean of the differences, with the bootstrap's 95 % percentile interval.

    Args:
        differences: One a pair.
        clusters: To which cluster each pair belongs.

    Raises:
        ValueError: If there is no pair, or not a cluster for each.
    """
    mean = clustered_mean(differences, clusters)
    means = resampled_means(differences, clusters)
    if means is None:
        return DifferenceInterval(mean=mean, low=None, high=None)
    low, high = np.quantile(means, [0.025, 0.975])
    return DifferenceInterval(mean=mean, low=float(low), high=float(high))


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
) -> NDArray[np.float64] | None:
    """What the mean would have been with other clusters, drawn with replacement.

    Differences of the same clusters, named in the same order, are resampled by the same draws.

    Args:
        differences: One a pair.
        clusters: To which cluster each pair belongs.
        resamples: How many means.

    Returns:
        (resamples,) means; None where there is but one cluster.
    """
    names = list(dict.fromkeys(clusters))
    if len(names) < 2:
        return None
    sums, counts = np.zeros(len(names)), np.zeros(len(names))
    index = {name: number for number, name in enumerate(names)}
    for difference, cluster in zip(differences, clusters, strict=True):
        sums[index[cluster]] += difference
        counts[index[cluster]] += 1.0
    drawn = _draws(resamples, len(names))
    return np.asarray(sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1))


@lru_cache(maxsize=2)
def _draws(resamples: int, clusters: int) -> NDArray[np.intp]:
    """(resamples, clusters) which clusters are drawn; the same ones for all that have so many."""
    stream = hashlib.shake_256(_STREAM).digest(resamples * clusters * _BYTES)
    drawn = np.frombuffer(stream, "<u8") % clusters
    return drawn.astype(np.intp).reshape(resamples, clusters)
