"""How a kernel is called: from Python, and from other kernels.

Numba compiles a function anew for every number that is written at a call (`f(x, 0)`), for each
width of its integers, and always with what lets Python call it. Most kernels are only called by
kernels, and none asks for more than values: that was a third of the time that a first run waits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from typing import Any

from numba.core import types as numba_types
from numba.core.caching import NullCache
from numba.core.registry import CPUDispatcher
from numba.core.typing import Signature

from di_envs.numerics.code_cache import CodeCache
from di_envs.numerics.ingredients import IngredientCompiler, KernelCompiler
from di_envs.numerics.together import Part, Together

_OPTIONS = {"nopython": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


class KernelDispatcher(CPUDispatcher):
    """Compiles one function: itself for calls from Python, `within` for those from kernels.

    Attributes:
        parts: Of the types of its arguments, large kernels that it calls and the types that it
            calls them with. Two processes compile them beside each other.
    """

    def __init__(
        self,
        py_func: Callable[..., Any],
        locals: Mapping[str, Any] | None = None,
        targetoptions: Mapping[str, Any] | None = None,
    ) -> None:
        """Of a function; the other two arguments are Numba's own."""
        super().__init__(py_func, locals or {}, dict(targetoptions or _OPTIONS), KernelCompiler)
        self.parts: Callable[..., Iterable[Part]] | None = None
        self._begun: dict[tuple[Any, ...], Together] = {}
        self._cache_within = NullCache()

    def keep_in(self, cache: CodeCache, cache_within: CodeCache) -> None:
        """Says where its machine code is kept, as Numba's own `enable_caching` would."""
        self._cache, self._cache_within = cache, cache_within

    @cached_property
    def within(self) -> Any:
        """What other kernels call; most runs find all code in the caches and never ask for it."""
        options = _OPTIONS | {"no_cpython_wrapper": True}
        made = CPUDispatcher(self.py_func, {}, options, IngredientCompiler)
        made._cache = self._cache_within
        return made

    def prepare(self, given: tuple[Any, ...]) -> None:
        """Has its parts begun, unless its code for arguments of these types is at hand."""
        if self.parts and given not in self.overloads and given not in self._begun:
            if not self._cache.holds(given, self.targetctx):
                self._begun[given] = Together(list(self.parts(*given)), whole=(self, given))

    def compile(self, sig: Any) -> Any:
        """Compiles it for Python, unless it is: first its parts, if it must be."""
        given = tuple(sig.args if isinstance(sig, Signature) else sig)
        self.prepare(given)
        begun = self._begun.pop(given, None)
        if begun:
            begun.finish()
        return super().compile(sig)

    def compile_of_parts(self, given: tuple[Any, ...]) -> Any:
        """Compiles it for Python, its parts being at hand."""
        return super().compile(given)

    def get_call_template(self, args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
        """Compiles it for a kernel that calls it, with arguments of these types."""
        return self.within.get_call_template(
            tuple(map(plain, args)), {name: plain(arg) for name, arg in kws.items()}
        )

    def get_overload(self, sig: Any) -> Any:
        """What a call from a kernel resolves to."""
        return self.within.get_overload(sig)


def plain(argument: Any) -> Any:
    """The type that an argument is passed as: of its kind, not of its value, and 64 bits wide."""
    types: Any = numba_types
    kind = types.unliteral(argument)
    if isinstance(kind, types.Integer) and kind.signed and kind.bitwidth < types.int64.bitwidth:
        return types.int64
    return kind
