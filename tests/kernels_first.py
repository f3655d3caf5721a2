"""Compiles the kernels before the first test, so that no test's time holds somebody's compiling.

The first steps of a drive with every sensor touch the kernels that nearly all tests use; every
process that a test starts then loads what they made. Which sources were compiled last stands in
pytest's cache: unchanged ones are not driven again.
"""

from __future__ import annotations

import hashlib
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import pytest
from rich.console import Console

TOP = Path(__file__).resolve().parent.parent
REMEMBERED = "driveinsight/kernels"  # a key of pytest's cache


def compile_kernels(config: pytest.Config) -> None:
    """Compiles what the sources as they are ask for, with a line and a bar if there is much."""
    from di_envs.numerics.kernels import kernel_cache
    from leaderboard.running.compiling import compile_progress
    from leaderboard.running.warming import WORKS

    digest, cache = sources(), getattr(config, "cache", None)  # none with -p no:cacheprovider
    if cache and kernel_cache().is_dir() and cache.get(REMEMBERED, "") == digest:
        return
    with shown(config), compile_progress(Console()):
        for work in WORKS.values():
            work()
    if cache:
        cache.set(REMEMBERED, digest)


def sources() -> str:
    """Names all sources of kernels, the CPU and Numba."""
    from di_envs.numerics.kernels import kernel_sources, sources_digest

    modules = (path.relative_to(TOP).with_suffix("").parts for path in kernel_sources())
    return hashlib.sha256(
        "".join(sources_digest(".".join(m)) for m in modules).encode()
    ).hexdigest()


def shown(config: pytest.Config) -> AbstractContextManager[None]:
    """Lets through to the terminal what pytest keeps to itself."""
    capture = config.pluginmanager.getplugin("capturemanager")
    return capture.global_and_fixture_disabled() if capture else nullcontext()
