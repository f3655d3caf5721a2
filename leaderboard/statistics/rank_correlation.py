"""How alike the order of two rows of numbers is.

Source: Spearman: The Proof and Measurement of Association between Two Things, American Journal of
Psychology 1904.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def spearman(ours: Sequence[float], theirs: Sequence[float]) -> float | None:
    """Spearman's rank correlation, equal values sharing the mean of their ranks.

    Returns:
        -1..1; None below three pairs, or where one side has but one value.

    Raises:
        ValueError: If the two are not of one length.
    """
    if len(ours) != len(theirs):
        raise ValueError(f"a correlation is of pairs, not of {len(ours)} and {len(theirs)} values")
    if len(ours) < 3 or len(set(ours)) == 1 or len(set(theirs)) == 1:
        return None
    return float(np.corrcoef(_ranks(ours), _ranks(theirs))[0, 1])


def _ranks(values: Sequence[float]) -> NDArray[np.float64]:
    given = np.asarray(values, float)
    below = (given[None, :] < given[:, None]).sum(axis=1)
    equal = (given[None, :] == given[:, None]).sum(axis=1)
    return below + 0.5 * (equal + 1)
