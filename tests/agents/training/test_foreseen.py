"""Of who comes to a red light or waits there, only the way up to it is learnt."""

from __future__ import annotations

import numpy as np
import pytest

from agents.training.caching import MOMENT
from agents.training.foreseen import foreseen
from di_envs.town.lanes import LightState

RED, YELLOW, GREEN = (float(LightState[name]) for name in ("RED", "YELLOW", "GREEN"))


def a_moment(light, ahead_m, aside_m=0.0):
    """On a straight road; the ego stands for a second, then goes at 4 m/s."""
    moment = np.zeros(1, MOMENT)
    points = moment["routing"].shape[1]
    moment["routing"][0] = [[1.0 + n, 0.0, 0.0, 1.0] for n in range(points)]
    moment["traffic_lights"][0, 0] = (ahead_m, aside_m, 0.0, light, 1.0)
    moment["waypoints"][0, :, 0] = [0, 0, 2, 4, 6, 8, 10, 12]
    moment["valid"] = 1
    return moment


@pytest.mark.parametrize(
    ("light", "ahead_m", "aside_m", "learnt"),
    [
        (RED, 3.0, 0.0, 2),  # stands there: the start is not learnt
        (RED, 9.0, 0.0, 5),  # comes to it: 6.5 m
        (RED, 30.0, 0.0, 8),
        (RED, 3.0, 3.5, 8),  # of another lane
        (RED, 0.5, 0.0, 8),  # is on its way over the line
        (YELLOW, 3.0, 0.0, 8),
        (GREEN, 3.0, 0.0, 8),
    ],
)
def test_what_lies_beyond_a_red_light_is_not_learnt(light, ahead_m, aside_m, learnt):
    assert foreseen(a_moment(light, ahead_m, aside_m)).tolist() == [[n < learnt for n in range(8)]]
