"""Who stands, stands for something: where that is hidden, to stand is not learnt.

A planner that is not told of the light, the sign or the other that the expert waits for, and does
not see it, can only learn that whoever stands stands on. It would stand for ever.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agents.training.interest import line_m
from di_envs.town.lanes import LightState

FOR = ("obstacles", "traffic_lights", "stop_signs")  # what one stands for
_SOON, _STAYS_M = 2, 0.9  # waypoints within which who stays has not gone; who starts now goes 1.2 m
_CAME_MPS = 0.3  # faster than this, it has only come to a sign
_NEAR_M = 8.0  # from the ego's middle to a line that it waits at


def stands_for(moments: NDArray[np.void], valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(B, 3) for which of `FOR` the expert stays, or comes to a stand; for none where it drives.

    At a line it stands for its light unless that is green, and for its sign while it has only come;
    everywhere else for somebody.

    Args:
        moments: (B,) of `caching.MOMENT`.
        valid: (B, T) which waypoints are learnt.
    """
    gone_m = np.where(valid, np.hypot(*np.moveaxis(moments["waypoints"], 2, 0)), 0.0)
    stands = gone_m[:, :_SOON].max(axis=1) < _STAYS_M
    lights = line_m(moments, "traffic_lights") < _NEAR_M
    light = (lights & (moments["traffic_lights"][..., 3] != LightState.GREEN)).any(axis=1)
    sign = (line_m(moments, "stop_signs") < _NEAR_M).any(axis=1)
    sign &= (moments["speed_history"] > _CAME_MPS).any(axis=1) & ~light
    return stands[:, None] & np.stack([~light & ~sign, light, sign], axis=1)
