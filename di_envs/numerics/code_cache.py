"""Keeps the machine code of kernels in our caches; Numba's own settings stay the user's.

Numba has one folder for everybody's functions (`NUMBA_CACHE_DIR`), asks that it can be written even
to read from it, and lets a full disk end the program. Here code is read from wherever a cache of
ours lies, written where one can be, and where nothing can be kept functions are compiled anew.
"""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, NullCache
from numba.core.runtime.nrt import rtsys

from di_envs.files.caches import cache_folders, warn_not_kept, writable_cache

_CUT_SHORT = (EOFError, pickle.UnpicklingError)


class CodeCache(NullCache):
    """What a function compiled by Numba asks for its machine code, and gives it to."""

    def __init__(self, function: Callable[..., Any], part: str) -> None:
        """Of one function.

        Args:
            function: As Python has it.
            part: Of the caches; it must name the function's source and all that it builds on.
        """
        self._function, self._part = function, part
        self._found: dict[Any, Any] = {}  # code by signature, until it is asked for

    @property
    def cache_path(self) -> str:
        """Where it is read first."""
        return str(cache_folders(self._part)[0])

    def holds(self, sig: Any, target_context: Any) -> bool:
        """Whether there is code for a signature; if so, it is kept for who asks for it next."""
        if sig not in self._found:
            code = self.load_overload(sig, target_context)
            if code is None:
                return False
            self._found[sig] = code
        return True

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Code for a signature; None if there is none that can be read."""
        if sig in self._found:
            return self._found.pop(sig)
        for folder in cache_folders(self._part):
            try:
                code = _InFolder(self._function, folder).load_overload(sig, target_context)
            except (OSError, *_CUT_SHORT):
                continue
            if code is not None:
                return code
        return None

    def save_overload(self, sig: Any, cres: Any) -> None:
        """Keeps code, if it can be kept."""
        folder = writable_cache(self._part)
        if folder is None:
            return
        kept = _InFolder(self._function, folder)
        try:
            try:
                kept.save_overload(sig, cres)
            except _CUT_SHORT:  # what is there already
                kept.flush()
                kept.save_overload(sig, cres)
        except OSError as error:
            warn_not_kept(folder, error)


class _InFolder(FunctionCache):
    """Numba's files of one function's code, in a folder that is given."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._name, self._py_func = repr(function), function
        self._impl = _Files(function, folder)
        self._cache_path = str(folder)
        name, stamp = self._impl.filename_base, self._impl.locator.get_source_stamp()
        self._cache_file = IndexDataCacheFile(self._cache_path, name, stamp)
        self.enable()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Code for a signature; None if there is none.

        Numba would first import all that it can compile, a quarter of a second, of which code that
        is compiled needs what counts references alone.
        """
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


class _Files(CompileResultCacheImpl):
    """How the files are called and filled."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Place(function, folder)
        name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"
        self._filename_base = self.get_filename_base(name, getattr(sys, "abiflags", ""))


class _Place:
    """A folder as Numba asks for one."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._py_file, self._lineno = (
            function.__code__.co_filename,
            function.__code__.co_firstlineno,
        )
        self._folder = folder

    def get_cache_path(self) -> str:
        """The folder."""
        return str(self._folder)

    def ensure_cache_path(self) -> None:
        """It is there: `writable_cache` has made it."""

    def get_source_stamp(self) -> str:
        """The folder's name stands for the source."""
        return ""

    def get_disambiguator(self) -> str:
        """Functions of one name in a module differ by their line."""
        return str(self._lineno)
