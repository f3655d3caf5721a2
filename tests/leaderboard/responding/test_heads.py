"""How steady heads are, on attention made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from leaderboard.responding.heads import consistency, head_consistency, likeness, verdict_of_heads
from leaderboard.statistics.claim_verdict import ClaimVerdict
from tests.leaderboard.responding.made_drives import made_drive

FIRST, SECOND = [1.0, 0.0], [0.0, 1.0]


def moments(*rows):
    """(N, 1 layer, heads, 2) shares."""
    return np.array(rows, np.float32)[:, None]


def drives(attention, routes=4):
    return [
        made_drive([[1.0, 1.0]] * len(attention), route=str(n), attention=attention)
        for n in range(routes)
    ]


def test_a_head_that_never_looks_elsewhere_has_one():
    steady = moments([FIRST, SECOND], [FIRST, SECOND], [FIRST, SECOND])
    assert consistency(steady) == pytest.approx(np.ones((1, 2)))
    assert likeness(steady) == pytest.approx(-1.0)  # of two components: opposite


def test_a_head_that_looks_elsewhere_once_in_three():
    """Pairs of moments: one alike, two opposite: (1 - 1 - 1) / 3."""
    found = consistency(moments([FIRST], [FIRST], [SECOND]))
    assert found[0, 0] == pytest.approx(-1.0 / 3.0)


def test_correlations_are_numpys():
    draw = np.random.default_rng(0)
    attention = draw.dirichlet(np.ones(5), size=(4, 2, 3)).astype(np.float32)
    rows = [np.corrcoef(attention[:, 1, 2])[np.triu_indices(4, 1)].mean()]
    assert consistency(attention)[1, 2] == pytest.approx(rows[0], abs=1e-6)


def test_a_head_that_attends_to_all_alike_has_no_preference():
    assert consistency(moments([[0.5, 0.5]], [[0.5, 0.5]]))[0, 0] == 0.0


def test_steady_heads_of_different_taste_keep_preferences():
    found = head_consistency(drives(moments([FIRST, SECOND], [FIRST, SECOND])))
    assert found.favourites == (("traffic_lights", "speed"),)
    assert found.excess.value == pytest.approx(2.0)
    assert verdict_of_heads(found) == ClaimVerdict.HOLDS


def test_steady_heads_of_one_taste_have_none_of_their_own():
    found = head_consistency(drives(moments([FIRST, FIRST], [FIRST, FIRST])))
    assert (found.mean.value, found.excess.value) == pytest.approx((1.0, 0.0))
    assert verdict_of_heads(found) == ClaimVerdict.DOES_NOT_HOLD


def test_two_routes_are_too_few_to_tell():
    few = head_consistency(drives(moments([FIRST, SECOND], [FIRST, SECOND]), routes=2))
    assert verdict_of_heads(few) == ClaimVerdict.UNDECIDED


def test_a_policy_without_attention_has_no_heads():
    assert head_consistency([made_drive([[1.0, 1.0]])]) is None
