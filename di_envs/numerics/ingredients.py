"""Code that is only ever compiled into other code.

Numba makes machine code of every function, although one that only kernels call never runs by
itself: whatever calls it has a copy. Here such a function stays what it is compiled from.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

_ENVIRONMENT = "_ZN08NumbaEnv"  # begins the name of what Numba keeps of each function at run time


class _Ingredient(JITCodeLibrary):
    """A library that others link, and whose own machine code holds nothing but environments."""

    _final_module: Any  # of LLVM

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


class IngredientCompiler(Compiler):
    """Compiles a function for kernels that call it."""

    def define_pipelines(self) -> list[object]:
        """Numba's own, into a library of ours."""
        state = self.state
        state.library = _Ingredient(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        pipelines: list[object] = super().define_pipelines()
        return pipelines
