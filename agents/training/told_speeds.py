"""Speeds that a share of samples is told wrong, so that how it went is no reason to go on.

What is then right is what the scene asks for, and not to go on as one went: who has rolled for a
moment at a red light is else taken for one who starts (de Haan et al., Causal Confusion in
Imitation Learning, NeurIPS 2019).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.keyed_arrays import keyed_normals, keyed_uniforms, stream_of

_MISTOLD, _OFF = stream_of("speeds that are told wrong"), stream_of("how far off speeds are told")
_OFF_MPS = 1.0  # standard deviation of a speed that is told wrong


def told_speeds(
    moments: NDArray[np.void] | Mapping[str, Any], mistold: float, key: int
) -> dict[str, NDArray[np.float32]]:
    """The speeds, present (B, 1) and past (B, K), as samples are told them.

    Args:
        moments: With `speed` (B, 1) and `speed_history` (B, K) [m/s].
        mistold: The share of samples that is told wrong ones.
        key: Of all draws.
    """
    speeds = np.concatenate([moments["speed"], moments["speed_history"]], axis=1)
    wrong = keyed_uniforms(key, _MISTOLD, 0, (len(speeds), 1)) < mistold
    off = wrong * _OFF_MPS * keyed_normals(key, _OFF, 0, speeds.shape)
    told = (speeds + off).clip(min=0.0).astype(np.float32)
    now = moments["speed"].shape[1]
    return {"speed": told[:, :now], "speed_history": told[:, now:]}
