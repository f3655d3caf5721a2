"""Names that NumPy has dropped, and that agents written before still say: `numpy.int` and the like.

They go where an agent for CARLA is loaded, as a rule a process of its own, and only where NumPy has
none of that name. What NumPy 1.24 and 2.0 took away otherwise cannot be put back from outside.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

_DROPPED: Mapping[str, Any] = {
    "int": int,
    "float": float,
    "complex": complex,
    "object": object,
    "str": str,
    "float_": np.float64,
    "complex_": np.complex128,
    "string_": np.bytes_,
    "unicode_": np.str_,
    "Inf": np.inf,
    "Infinity": np.inf,
    "infty": np.inf,
    "NaN": np.nan,
}


def put_back() -> None:
    """Gives NumPy those of the names that it lacks."""
    for name, value in _DROPPED.items():
        if name not in vars(np):
            setattr(np, name, value)
