"""Waypoints that follow from what can be known: none that a light has yet to give way for.

When a red light will turn green nobody at it can know, and labels that show the expert's start
would teach to guess: a planner then rolls while it is red. So of who comes to a red light or waits
there, only the way up to it is learnt.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agents.training.interest import line_m
from di_envs.town.lanes import LightState

_STANDS_M = 2.5  # so far before a line whoever waits there stands, from the ego's middle
_STARTED_M = 0.3  # who goes farther from there has started
PAST_M = 1.0  # who is nearer to the line than this is on its way over it
_AT_ONCE = 4096  # moments that are looked at together


def foreseen(rows: NDArray[np.void]) -> NDArray[np.bool_]:
    """(M, T) which waypoints of moments are not beyond a light that is still red.

    Args:
        rows: (M,) of `caching.MOMENT`.
    """
    known = np.ones(rows["valid"].shape, np.bool_)
    for first in range(0, len(rows), _AT_ONCE):
        some = rows[first : first + _AT_ONCE]
        lights = some["traffic_lights"].astype(np.float64)
        own = np.isfinite(line_m(some, "traffic_lights")) & (lights[..., 0] > PAST_M)
        ahead_m = np.hypot(lights[..., 0], lights[..., 1])
        red_m = np.where(own & (lights[..., 3] == LightState.RED), ahead_m, np.inf)
        nearest_m = red_m.min(axis=1, keepdims=True)
        ways = np.diff(some["waypoints"].astype(np.float64), axis=1, prepend=0.0)
        gone_m = np.hypot(ways[..., 0], ways[..., 1]).cumsum(axis=1)
        passes = gone_m > np.maximum(nearest_m - _STANDS_M, _STARTED_M)
        known[first : first + _AT_ONCE] = ~np.logical_or.accumulate(passes, axis=1)
    return known
