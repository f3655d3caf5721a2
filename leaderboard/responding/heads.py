"""How steady an attention head is: whether it looks at the same components all along a drive.

The consistency of a head is the mean correlation (Pearson, over the components) between what it
attends to at two moments, over all pairs of moments of a drive. 1: always the same; 0: no more
alike than chance. Beside it stands how much the heads of one layer are alike at the same moment: if
all heads look at the same things always, they are steady without preferences of their own.

The paper says that heads have preferences and keep them (section 4.2.3); it gives no number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from leaderboard.responding.drive_responses import DriveResponses
from leaderboard.statistics.bootstrap import (
    BootstrapInterval,
    cluster_sums,
    pooled_mean_interval,
)
from leaderboard.statistics.claim_verdict import ClaimVerdict, verdict_of_interval

_SLIGHT_EXCESS = 0.1  # a smaller difference of correlations is none


@dataclass(frozen=True, kw_only=True)
class HeadConsistency:
    """Of one policy's heads, over drives.

    Attributes:
        heads: (layers, heads) consistency, the mean over drives.
        favourites: (layers, heads) the component that each attends to most, over all moments.
        mean: Of all heads.
        alike: Of the heads of a layer with each other, at the same moment.
        excess: Consistency less likeness: above 0, heads have preferences of their own.
    """

    heads: NDArray[np.float64]
    favourites: tuple[tuple[str, ...], ...]
    mean: BootstrapInterval
    alike: BootstrapInterval
    excess: BootstrapInterval


def head_consistency(drives: Sequence[DriveResponses]) -> HeadConsistency | None:
    """The consistency of a policy's heads; None for a policy without attention.

    Args:
        drives: Of one policy.
    """
    if not drives or not drives[0].attention.size:
        return None
    each = np.stack([consistency(drive.attention) for drive in drives])  # (D, layers, heads)
    alike = np.array([likeness(drive.attention) for drive in drives])
    mean = each.mean(axis=(1, 2))
    routes = [drive.route_hash for drive in drives]

    def interval(values: NDArray[np.float64]) -> BootstrapInterval:
        return pooled_mean_interval(
            cluster_sums(np.stack([values, np.ones_like(values)], 1), routes)
        )

    total = np.concatenate([drive.attention for drive in drives]).mean(axis=0)
    names = drives[0].groups
    return HeadConsistency(
        heads=each.mean(axis=0),
        favourites=tuple(tuple(names[k] for k in layer) for layer in total.argmax(axis=2)),
        mean=interval(mean),
        alike=interval(alike),
        excess=interval(mean - alike),
    )


def verdict_of_heads(found: HeadConsistency) -> ClaimVerdict:
    """Whether heads keep preferences of their own, by the interval of the excess."""
    excess = found.excess
    return verdict_of_interval(excess.low, excess.high, holds_above=0.0, fails_below=_SLIGHT_EXCESS)


def consistency(attention: NDArray[np.float32]) -> NDArray[np.float64]:
    """(layers, heads) mean correlation between moments of (N, layers, heads, G) shares."""
    return _mean_correlation(_standardised(attention), axis=0)


def likeness(attention: NDArray[np.float32]) -> float:
    """Mean correlation between heads of a layer at a moment, over layers and moments."""
    if attention.shape[2] < 2:
        return 0.0
    return float(_mean_correlation(_standardised(attention), axis=2).mean())


def _standardised(attention: NDArray[np.float32]) -> NDArray[np.float64]:
    """Shares less their mean over components, of length 1: their products are correlations.

    A head that attends to all alike has no preference: its row is zeros.
    """
    shares = attention.astype(np.float64)
    shares = shares - shares.mean(axis=-1, keepdims=True)
    length = np.linalg.norm(shares, axis=-1, keepdims=True)
    even = length < 1e-9
    return np.where(even, 0.0, shares / np.where(even, 1.0, length))


def _mean_correlation(rows: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Mean product of all pairs of different rows along an axis: (|sum|^2 - sum |.|^2) / pairs."""
    count = rows.shape[axis]
    if count < 2:
        return np.ones(np.delete(rows.shape[:-1], axis))
    whole = (rows.sum(axis=axis) ** 2).sum(axis=-1)
    own = (rows**2).sum(axis=-1).sum(axis=axis)
    result: NDArray[np.float64] = (whole - own) / (count * (count - 1))
    return result
