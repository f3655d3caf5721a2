"""Integers of one width in kernels."""

from __future__ import annotations

import numpy as np

from di_envs.numerics.kernels import kernel


@kernel
def as_int64(number: int) -> int:
    """The same number in 64 bits, so that what reads it is compiled once.

    Numba compiles a kernel anew for an element of an int32 array and for each constant.
    """
    return int(np.int64(number))
