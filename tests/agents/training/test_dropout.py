"""Which components training hides, alone and together, and how one is measured without some."""

from __future__ import annotations

import numpy as np
import pytest

from agents.driveinsight.config import TOKENS, config_named
from agents.training.samples import hidden_components, without


def test_each_of_obstacles_and_bev_is_hidden_alone_together_and_not_at_all_often_enough():
    given = hidden_components(config_named("driveinsight"), 4000, key=1).numpy() > 0.0
    obstacles, bev = given[:, TOKENS.index("obstacles")], given[:, TOKENS.index("bev")]
    for one in (True, False):
        for other in (True, False):
            assert ((obstacles == one) & (bev == other)).mean() > 0.05
    lights = given[:, TOKENS.index("traffic_lights")]
    assert (lights & ~obstacles & ~bev).mean() > 0.05  # told to go, and nothing of who stands there
    told = [TOKENS.index(n) for n in ("map", "obstacles", "traffic_lights", "stop_signs")]
    assert (~given[:, told]).all(axis=1).mean() == pytest.approx(0.5, abs=0.05)


def test_without_names_what_is_hidden_and_nothing_else():
    given = without("obstacles+bev", 2)
    assert given.shape == (2, len(TOKENS))
    assert {TOKENS[n] for n in np.flatnonzero(given[0] == 0.0)} == {"obstacles", "bev"}
    assert without("", 1).all()
