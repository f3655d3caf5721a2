"""How kernels are compiled and where their machine code is kept.

Numba's own cache goes stale when a helper in another module changes, so a kernel is cached in a
folder of ours (`di_envs.files.caches`) that is named by its source and those it builds on, Numba's
version and the CPU. A change of any of these gives a new folder, never stale code.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import sys
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

# Bits must not depend on whether Intel's vector maths library is installed; read when numba loads.
os.environ.setdefault("NUMBA_DISABLE_INTEL_SVML", "1")

import llvmlite.binding
import numba

from di_envs.files.caches import cache_folders
from di_envs.numerics.code_cache import CodeCache
from di_envs.numerics.dispatcher import KernelDispatcher
from di_envs.numerics.together import Part

Function = TypeVar("Function", bound=Callable[..., Any])

_PART = "kernels"  # of the caches
# What only says where code is kept and who compiles it, not what it does
_KEEPING = ("di_envs.files.caches", "di_envs.numerics.code_cache", "di_envs.numerics.together")
_IMPORT = re.compile(rb"^from ((?:di_envs|agents)[.\w]*) import", re.MULTILINE)


@cache
def _source(module: str) -> tuple[bytes, tuple[str, ...]]:
    """A module's source, and the modules of ours that it imports names from."""
    loaded = getattr(sys.modules.get(module), "__file__", None)
    spec = None if loaded else importlib.util.find_spec(module)
    path = loaded or (spec.origin if spec else None)
    text = Path(path).read_bytes() if path else b""
    imported = {match.decode() for match in _IMPORT.findall(text)}
    return text, tuple(sorted(imported.difference(_KEEPING)))


@cache
def sources_digest(module: str) -> str:
    """Names a module's source and all sources of ours that it builds on, directly or not."""
    seen: dict[str, bytes] = {}
    todo = [module]
    while todo:
        name = todo.pop()
        if name not in seen:
            seen[name], imported = _source(name)
            todo += imported
    digest = hashlib.sha256()
    for name in sorted(seen):
        digest.update(name.encode() + b"\0" + seen[name] + b"\0")
    digest.update(f"{numba.__version__} {sys.version_info[:3]} {cpu_capability()}".encode())
    return digest.hexdigest()[:16]


@cache
def cpu_capability() -> str:
    """The CPU that code is compiled for: its name and a hash of the features it offers."""
    features = llvmlite.binding.get_host_cpu_features().flatten()
    digest = hashlib.sha256(features.encode()).hexdigest()[:8]
    return f"{llvmlite.binding.get_host_cpu_name()}-{digest}"


def kernel_sources() -> list[Path]:
    """Every file of ours that defines kernels, in a fixed order."""
    top = Path(__file__).resolve().parents[2]
    files = (path for root in ("di_envs", "agents") for path in sorted((top / root).rglob("*.py")))
    return [path for path in files if "\n@kernel\n" in path.read_text(encoding="utf-8")]


def kernel_cache() -> Path:
    """The folder where compiled kernels are looked for first."""
    return cache_folders(_PART)[0]


def kernel(function: Function) -> Function:
    """Compiles `function` without the Python interpreter, releasing the GIL, never `fastmath`."""
    if numba.config.DISABLE_JIT:
        return function
    compiled: Any = KernelDispatcher(function)
    part = f"{_PART}/{sources_digest(function.__module__)}"
    compiled.keep_in(CodeCache(function, part), CodeCache(function, f"{part}/within"))
    kernel: Function = compiled
    return kernel


def made_of(parts: Callable[..., Iterable[Part]]) -> Callable[[Function], Function]:
    """Says which large kernels one calls, so that two processes can compile them.

    Args:
        parts: Of the types of its arguments, kernels and the types of theirs. What is left out or
            wrong costs time alone.
    """

    def add(function: Function) -> Function:
        kernel: Any = function
        if not numba.config.DISABLE_JIT:
            kernel.parts = parts
        return function

    return add


def prepare(function: Callable[..., Any], arguments: Callable[[], tuple[Any, ...]]) -> None:
    """Has another process begin to compile what a kernel is made of, if it has never been called.

    Args:
        function: The kernel, which is said to be `made_of` others.
        arguments: Gives arguments as it will be called with.
    """
    kernel: Any = function
    if not numba.config.DISABLE_JIT and not kernel.overloads:
        kernel.prepare(tuple(map(numba.typeof, arguments())))


def bind(function: Function, *arguments: Any) -> Function:
    """The machine code of a kernel for arguments of these types.

    A call then skips the look-up of types, which takes longer than a small kernel's work. The
    caller answers for passing the same types each time: nothing checks them any more.
    """
    if numba.config.DISABLE_JIT:
        return function
    compiled: Any = function
    signature = tuple(numba.typeof(argument) for argument in arguments)
    if signature not in compiled.overloads:
        compiled.compile(signature)
    bound: Function = compiled.overloads[signature].entry_point
    return bound
