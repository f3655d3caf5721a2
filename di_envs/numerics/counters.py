"""A counter from which kernels of several threads take numbers, each of them once."""

from __future__ import annotations

from typing import Any

import di_envs.numerics.kernels  # noqa: F401  # isort: skip (says how Numba loads, so it comes first)
from numba.core import types
from numba.extending import intrinsic, overload
from numba.np.arrayobj import make_array


def take_next(counter: Any) -> int:
    """The number that an array of one integer holds, which becomes the next one.

    However many kernels call it at once, no two get the same number; Python has its own lock.
    """
    taken = int(counter[0])
    counter[0] = taken + 1
    return taken


@intrinsic
def _add_one(_context: Any, counter: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        array = make_array(signature.args[0])(context, builder, values[0])
        one = context.get_constant(signature.return_type, 1)
        return builder.atomic_rmw("add", array.data, one, "monotonic")

    return counter.dtype(counter), build


@overload(take_next)
def _overload_take_next(counter: Any) -> Any:
    if not (isinstance(counter, types.Array) and isinstance(counter.dtype, types.Integer)):
        return None

    def take(counter: Any) -> Any:
        return _add_one(counter)

    return take
