"""How kernels are compiled: for Python, and for kernels that call them, in less time than Numba's.

Numba makes machine code of every function and optimises it as far as it can, although one that only
kernels call never runs by itself: whatever calls it has a copy, and optimises that once more. Here
such a function stays what it is compiled from. And Numba works out anew for every sum of two
numbers what type it has, and what the flags are that it is compiled with; here that is done once.
"""

from __future__ import annotations

from types import BuiltinFunctionType
from typing import Any

import llvmlite.binding
from llvmlite.binding import Linkage
from numba.core import types as numba_types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags
from numba.core.typing import Signature

_ENVIRONMENT = "_ZN08NumbaEnv"  # begins the name of what Numba keeps of each function at run time


class _Ingredient(JITCodeLibrary):
    """A library that others link, and whose own machine code holds nothing but environments."""

    _final_module: Any  # of LLVM

    def _optimize_final_module(self) -> None:
        """Only what Numba does first, which drops what nobody needs; the rest is for who calls."""
        passes, builder = self._codegen._module_pass_manager(
            opt=0, loop_vectorize=False, slp_vectorize=False, cost="cheap"
        )
        passes.run(self._final_module, builder)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True  # as what follows asks for it
        self._get_module_for_linking()
        self._finalized = False
        kept = [
            str(v) for v in self._final_module.global_variables if v.name.startswith(_ENVIRONMENT)
        ]
        module = llvmlite.binding.parse_assembly("\n".join(kept))
        module.name, module.triple = self._final_module.name, self._final_module.triple
        module.data_layout = self._final_module.data_layout
        self._final_module = module
        super()._finalize_final_module()


class _Told(Flags):
    """Flags that nobody changes any more: what they hash to and equal is worked out once."""

    __slots__ = ("_hash", "_told")

    def __init__(self, flags: Flags) -> None:
        super().__init__(flags)
        self._told = super().values()
        self._hash = super().__hash__()

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if isinstance(other, _Told):
            return self is other or self._told == other._told
        return bool(super().__eq__(other))

    def values(self) -> dict[str, Any]:
        """All options by their names."""
        return self._told


class _Asked(Flags):
    """Flags whose copy, which Numba asks while it compiles a function, does not change."""

    __slots__ = ()

    def copy(self) -> Flags:
        """As they are now."""
        return _Told(self)


class _Remembering:
    """A typing context that works out the types of one call of Numba's own functions once."""

    def __init__(self, context: Any, known: dict[Any, Signature]) -> None:
        self._context, self._known = context, known

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(
        self, func: Any, args: tuple[Any, ...], kws: dict[str, Any]
    ) -> Signature | None:
        """The types of a call of a function; None if it cannot be called so."""
        if kws or not isinstance(func, _OF_NUMBA):
            return self._context.resolve_function_type(func, args, kws)
        key = func, tuple(args)
        found = self._known.get(key)
        if found is None:
            found = self._context.resolve_function_type(func, args, kws)
            if found is not None:
                self._known[key] = found
        return found


class _Whole(JITCodeLibrary):
    """A library that Python calls and nobody links: what it is made of is its own."""

    _final_module: Any  # of LLVM

    def _optimize_final_module(self) -> None:
        """Knowing that nobody else calls them, LLVM puts functions in the place of their calls."""
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.linkonce_odr:
                function.linkage = Linkage.internal
        super()._optimize_final_module()

    def serialize_using_object_code(self) -> tuple[str, str, tuple[bytes, bytes]]:
        """Its machine code, and what that defines: Numba keeps all that others could link there."""
        self._ensure_finalized()
        defined = (f for f in self._final_module.functions if not f.is_declaration)
        names = (f.name for f in defined if f.linkage != Linkage.internal)
        module = llvmlite.binding.parse_assembly(
            "\n".join(f'define void @"{name}"() {{ ret void }}' for name in names)
        )
        return self.name, "object", (self._get_compiled_object(), module.as_bitcode())


# Functions such as `math.sqrt`, types that numbers are made of, operators
_OF_NUMBA = (numba_types.Function, numba_types.NumberClass, BuiltinFunctionType)
_known_calls: dict[Flags, dict[Any, Signature]] = {}


class KernelCompiler(Compiler):
    """Compiles a function for Python."""

    library_class = _Whole

    def _compile_core(self) -> Any:
        state = self.state
        state.flags = _Asked(state.flags)
        known = _known_calls.setdefault(state.flags.copy(), {})
        state.typingctx = _Remembering(state.typingctx, known)
        state.library = self.library_class(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super()._compile_core()


class IngredientCompiler(KernelCompiler):
    """Compiles a function for kernels that call it."""

    library_class = _Ingredient
