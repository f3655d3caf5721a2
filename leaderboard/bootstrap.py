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

import numpy as np

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
    if not differences or len(differences) != len(clusters):
        raise ValueError("a mean difference needs at least one pair, and a cluster for each")
    mean = math.fsum(differences) / len(differences)
    names = list(dict.fromkeys(clusters))
    if len(names) == 1:
        return DifferenceInterval(mean=mean, low=None, high=None)
    sums, counts = np.zeros(len(names)), np.zeros(len(names))
    index = {name: number for number, name in enumerate(names)}
    for difference, cluster in zip(differences, clusters, strict=True):
        sums[index[cluster]] += difference
        counts[index[cluster]] += 1.0
    stream = hashlib.shake_256(_STREAM).digest(RESAMPLES * len(names) * _BYTES)
    drawn = (np.frombuffer(stream, "<u8") % len(names)).reshape(RESAMPLES, -1)
    means = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return DifferenceInterval(mean=mean, low=float(low), high=float(high))
