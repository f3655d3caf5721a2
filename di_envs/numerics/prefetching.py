"""Asking for memory before it is needed: the processor fetches it while it works on something else.

It changes nothing but time. What is asked for lies in an array that is there; where it is wrong,
nothing is lost but the fetching.
"""

from __future__ import annotations

from typing import Any

import di_envs.numerics.kernels  # noqa: F401  # isort: skip (says how Numba loads, so it comes first)
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, overload
from numba.np.arrayobj import make_array

_READ, _KEEP, _DATA = 0, 3, 1  # of LLVM's `prefetch`: to read, into all caches, no instructions


def prefetch(table: Any, row: int) -> None:
    """Asks for the first 64 bytes of a row of an array, from a kernel; Python has no use for it."""


@intrinsic
def _prefetch(_context: Any, table: Any, row: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        array = make_array(signature.args[0])(context, builder, values[0])
        at = context.cast(builder, values[1], signature.args[1], types.intp)
        stride = cgutils.unpack_tuple(builder, array.strides)[0]
        byte, word = ir.IntType(8).as_pointer(), ir.IntType(32)
        place = builder.gep(builder.bitcast(array.data, byte), [builder.mul(at, stride)])
        kind = ir.FunctionType(ir.VoidType(), [byte, word, word, word])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        builder.call(function, [place, *(ir.Constant(word, n) for n in (_READ, _KEEP, _DATA))])
        return context.get_dummy_value()

    return types.void(table, row), build


@overload(prefetch)
def _overload_prefetch(table: Any, row: Any) -> Any:
    if not (isinstance(table, types.Array) and isinstance(row, types.Integer)):
        return None

    def prefetch_row(table: Any, row: Any) -> Any:
        _prefetch(table, row)

    return prefetch_row
