"""Spearman's rank correlation: by hand, and as SciPy has it."""

from __future__ import annotations

import numpy as np
import pytest

from leaderboard.statistics.rank_correlation import spearman


def test_rank_correlation_by_hand():
    """Ranks 1 2 3 4 against 1 2 4 3: 1 - 6 * 2 / (4 * 15) = 0.8."""
    assert spearman([10.0, 20.0, 30.0, 40.0], [1.0, 2.0, 9.0, 3.0]) == pytest.approx(0.8)
    assert spearman([1.0, 2.0, 3.0], [30.0, 20.0, 10.0]) == pytest.approx(-1.0)
    assert spearman([1.0, 2.0], [1.0, 2.0]) is None
    assert spearman([1.0, 1.0, 1.0], [1.0, 2.0, 3.0]) is None
    with pytest.raises(ValueError, match="not of 1 and 2"):
        spearman([1.0], [1.0, 2.0])


def test_rank_correlation_with_ties_is_scipys():
    stats = pytest.importorskip("scipy.stats")
    rng = np.random.default_rng(0)
    for _ in range(20):
        one, two = rng.integers(0, 5, (2, 9))
        assert spearman(one, two) == pytest.approx(stats.spearmanr(one, two).statistic)
