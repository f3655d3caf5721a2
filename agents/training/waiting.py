"""Who waits at a red light waits, whoever else is about: those who are, are somebody else's.

Few moments wait at a red light, so what stood round them is soon known by heart: where others stood
otherwise, as in a town never seen, a planner at its own red light went. Of such a moment all may be
changed but its own way, its speed and that light, and what follows from it stays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.training.interest import line_m
from di_envs.numerics.keyed_arrays import keyed_uniforms, stream_of
from di_envs.town.lanes import LightState

_STREAM = stream_of("who waits among others")
_NEAR_M = 8.0  # from the ego's middle to a line that it waits at
_STANDS_MPS, _STAYS_M = 0.3, 0.3
_OTHERS = ("obstacles", "map_places", "map_kinds", "stop_signs")
_STATES = np.array([LightState.GREEN, LightState.YELLOW, LightState.RED])


def among_others(
    moments: NDArray[np.void], valid: NDArray[np.bool_], share: float, key: int
) -> NDArray[np.bool_]:
    """Gives some moments that wait at a red light the surroundings of the one before, in place.

    Args:
        moments: (B,) of `caching.MOMENT`, as they are learnt.
        valid: (B, T) which waypoints are learnt.
        share: Of the moments that wait.
        key: Of all draws.

    Returns:
        (B,) to which it was done: what they see of objects is the one's before, too.
    """
    lights = moments["traffic_lights"]
    near = line_m(moments, "traffic_lights") < _NEAR_M
    own = near & (lights[..., 3] == LightState.RED)
    gone_m = np.where(valid, np.hypot(*np.moveaxis(moments["waypoints"], 2, 0)), 0.0).max(axis=1)
    waits = own.any(axis=1) & (moments["speed"][:, 0] < _STANDS_MPS) & (gone_m < _STAYS_M)
    drawn = keyed_uniforms(key, _STREAM, 0, (len(moments), 1 + lights.shape[1]))
    waits &= (drawn[:, 0] < share) & valid.any(axis=1)
    for name in _OTHERS:
        moments[name] = of_the_one_before(moments[name], waits)
    others = waits[:, None] & (lights[..., 4] > 0.0) & ~near
    shown = _STATES[(drawn[:, 1:] * len(_STATES)).astype(np.int64)]
    lights[..., 3] = np.where(others, shown, lights[..., 3])
    return waits


def of_the_one_before(values: NDArray[Any], which: NDArray[np.bool_]) -> NDArray[Any]:
    """(B, ...) values, of those that are meant the ones of the moment before in the batch."""
    meant = which.reshape(-1, *(1,) * (values.ndim - 1))
    return np.where(meant, np.roll(values, 1, axis=0), values)
