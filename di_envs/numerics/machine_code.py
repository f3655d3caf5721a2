"""Kernels that another kernel calls by their address, so that nothing of them is compiled into it.

Numba compiles all that a kernel calls once more, as part of it. For a kernel that steps whole
worlds that would be nearly everything there is, many seconds for nothing. It takes the machine code
of the large ones as arguments instead.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from di_envs.numerics.bundles import unboxed_by  # isort: skip (says how Numba loads, so it comes first)
import numba
from numba.core import cgutils, types
from numba.extending import (
    intrinsic,
    models,
    overload,
    register_model,
    typeof_impl,
    unbox,
)


class MachineCode:
    """A kernel compiled for arguments of certain types: kernels call it by `call`.

    Attributes:
        signature: Numba's, of the arguments and what comes back.
        code_address: Where the code begins.
    """

    signature: Any = None
    code_address = 0

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Compiles `function` for arguments of these types, unless it is compiled already."""
        self.function = function
        if numba.config.DISABLE_JIT:
            return
        kernel: Any = function
        given = tuple(numba.typeof(argument) for argument in arguments)
        kernel.compile(given)
        result = kernel.overloads[given]
        self.signature = result.signature
        self.code_address = result.library.get_pointer_to_function(result.fndesc.llvm_func_name)


def call(code: MachineCode, *arguments: Any) -> Any:
    """Calls machine code with arguments of the types that it was compiled for."""
    return code.function(*arguments)


class MachineCodeType(types.Type):
    """Numba's type of machine code: its signature."""

    def __init__(self, signature: Any) -> None:
        self.signature = signature
        super().__init__(name=f"MachineCode{signature}")


@typeof_impl.register(MachineCode)
def _code_type(code: MachineCode, _context: object) -> MachineCodeType:
    return MachineCodeType(code.signature)


@register_model(MachineCodeType)
class _CodeModel(models.OpaqueModel):
    """A pointer to the code."""


unbox(MachineCodeType)(unboxed_by("code_address"))


@intrinsic
def _call(_context: Any, code: MachineCodeType, arguments: Any) -> Any:
    wanted = code.signature

    def build(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        parts = cgutils.unpack_tuple(builder, values[1])
        kinds = zip(parts, signature.args[1], wanted.args, strict=True)
        cast = [context.cast(builder, part, given, kind) for part, given, kind in kinds]
        convention = context.call_conv
        kind_of_code = convention.get_function_type(wanted.return_type, wanted.args)
        function = builder.bitcast(values[0], kind_of_code.as_pointer())
        status, result = convention.call_function(
            builder, function, wanted.return_type, wanted.args, cast
        )
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return result

    return wanted.return_type(code, arguments), build


@overload(call)
def _overload_call(code: Any, *arguments: Any) -> Any:
    if not isinstance(code, MachineCodeType):
        return None

    def call_code(code: Any, *arguments: Any) -> Any:
        return _call(code, arguments)

    return call_code
