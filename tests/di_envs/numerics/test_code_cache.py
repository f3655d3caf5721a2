"""Compiled kernels are read from any cache, kept in one that can be written, or not at all."""

from __future__ import annotations

import errno
import os
import subprocess
import sys

import numba
import pytest

from di_envs.files import caches
from di_envs.files.caches import CacheWarning
from di_envs.numerics import code_cache
from di_envs.numerics.code_cache import CodeCache


def twice(number):
    return 2 * number


def fresh():
    """The function as a new process has it: nothing is compiled yet."""
    compiled = numba.njit(twice)
    compiled._cache = CodeCache(twice, "kernels/one")
    return compiled


def hits(compiled) -> int:
    return sum(compiled.stats.cache_hits.values())


@pytest.fixture
def places(tmp_path, monkeypatch):
    """Two places for caches, the first of which is asked for."""
    monkeypatch.setenv(caches.ASKED, str(tmp_path / "asked"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    caches._warn.cache_clear()
    return tmp_path


def read_only(monkeypatch, place):
    can_write = caches._can_write
    monkeypatch.setattr(
        caches, "_can_write", lambda folder: not folder.is_relative_to(place) and can_write(folder)
    )


def test_code_is_compiled_once_and_read_from_a_cache_that_cannot_be_written(places, monkeypatch):
    first = fresh()
    assert (first(4), hits(first)) == (8, 0)
    read_only(monkeypatch, places)
    second = fresh()
    assert (second(4), hits(second)) == (8, 1)


def test_what_is_not_in_the_read_only_cache_is_kept_in_the_next_place(places, monkeypatch):
    read_only(monkeypatch, places / "asked")
    assert fresh()(4) == 8
    assert not (places / "asked").exists()
    assert list((places / "home/driveinsight/kernels/one").glob("*.nbc"))
    again = fresh()
    assert (again(4), hits(again)) == (8, 1)


def test_with_a_full_disk_code_is_compiled_with_one_warning(places, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(code_cache.IndexDataCacheFile, "save", full)
    compiled = fresh()
    with pytest.warns(CacheWarning, match="No space left on device") as told:
        assert (compiled(4), compiled(4.5)) == (8, 9.0)
    assert len(told) == 1


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_code_that_was_cut_short_is_compiled_anew(places, suffix):
    assert fresh()(4) == 8
    (path,) = (places / "asked/kernels/one").glob(f"*.{suffix}")
    path.write_bytes(path.read_bytes()[:40])
    compiled = fresh()
    assert (compiled(4), hits(compiled)) == (8, 0)


def test_numbas_own_cache_stays_where_the_user_has_put_it():
    import di_envs.world.step  # noqa: F401 (has kernels, which need a cache)

    assert os.environ.get("NUMBA_CACHE_DIR", "") == numba.config.CACHE_DIR


def test_code_that_was_looked_for_is_read_once(places, monkeypatch):
    cache, types = fresh()._cache, (numba.int64,)
    assert not cache.holds(types, fresh().targetctx)
    assert fresh()(4) == 8
    assert cache.holds(types, fresh().targetctx)
    for path in (places / "asked/kernels/one").iterdir():
        path.unlink()
    assert cache.holds(types, fresh().targetctx)
    assert cache.load_overload(types, fresh().targetctx).entry_point(4) == 8
    assert not cache.holds(types, fresh().targetctx)


A_STEP = """
import sys
import numpy as np
from di_envs.route_env import RouteEnv
env = RouteEnv(suite="toy", traffic=2, walkers=1, observations=("camera", "prompt"))
env.reset(seed=0)
env.step(np.array([0.5, 0.0, 0.0], np.float32))
print("numba.np.linalg" in sys.modules)  # of all that Numba can compile
"""


def test_who_finds_all_code_does_not_load_what_compiles_it():
    for _ in range(2):  # the first may compile
        run = subprocess.run(
            [sys.executable, "-c", A_STEP], capture_output=True, text=True, check=True
        )
    assert run.stdout == "False\n"
