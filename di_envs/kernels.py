"""How kernels are compiled and where their machine code is kept.

Numba's own cache goes stale when a helper in another module changes, so every kernel is cached in a
directory of the user's cache folder that is named by all kernel sources, Numba's version and the
CPU. A change of any of these gives a new directory, never stale code.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

# Bits must not depend on whether Intel's vector maths library is installed; read when numba loads.
os.environ.setdefault("NUMBA_DISABLE_INTEL_SVML", "1")

import llvmlite.binding
import numba
from platformdirs import user_cache_path

Function = TypeVar("Function", bound=Callable[..., Any])

_PACKAGE_ROOTS = ("di_envs", "agents")


def kernel_sources() -> list[Path]:
    """Every Python file of ours that defines a kernel, in a fixed order."""
    top = Path(__file__).resolve().parent.parent
    files = (path for root in _PACKAGE_ROOTS for path in sorted((top / root).rglob("*.py")))
    return [path for path in files if "@kernel" in path.read_text(encoding="utf-8")]


def cpu_capability() -> str:
    """The CPU that code is compiled for: its name and a hash of the features it offers."""
    features = llvmlite.binding.get_host_cpu_features().flatten()
    digest = hashlib.sha256(features.encode()).hexdigest()[:8]
    return f"{llvmlite.binding.get_host_cpu_name()}-{digest}"


def cache_directory() -> Path:
    """The folder of this version's machine code, below the user's cache folder."""
    digest = hashlib.sha256()
    for path in kernel_sources():
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    digest.update(f"{numba.__version__} {sys.version_info[:3]} {cpu_capability()}".encode())
    return user_cache_path("driveinsight") / "kernels" / digest.hexdigest()[:16]


numba.config.CACHE_DIR = str(cache_directory())


def kernel(function: Function) -> Function:
    """Compiles `function` without the Python interpreter, releasing the GIL, never `fastmath`."""
    compiled: Function = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    return compiled
