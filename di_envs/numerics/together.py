"""Compiles kernels in two processes: each takes the next that nobody has taken.

Who waits for a first run has a second core that does nothing. The other process is told types
alone, and leaves machine code in the caches, where this one finds it; if it cannot be had, this one
does it all.
"""

from __future__ import annotations

import importlib
import os
import pickle
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import IO, Any

from numba.core import event as numba_event

Part = tuple[Any, tuple[Any, ...]]  # a kernel, and Numba's types that a kernel calls it with

_EVENT = "numba:compile"
# It finds modules where this process does. Kernels say how Numba loads, so they come first.
_HELP = """
import sys
sys.path[:] = sys.argv[1:]
import di_envs.numerics.kernels
from di_envs.numerics.together import help_out
help_out()
"""


class Together:
    """Kernels to be compiled as other kernels call them, and then the one that is made of them.

    The other process begins at once.
    """

    def __init__(self, parts: Sequence[Part], whole: Part) -> None:
        """Starts the other process, if there is a core for it."""
        self._left, self._whole = deque([*parts, whole]), whole
        self._taking = threading.Lock()
        self._helper = _helper() if len(parts) > 1 and _cores() > 1 else None
        self._thread = threading.Thread(target=self._hand_out, daemon=True)
        if self._helper:
            self._thread.start()

    def finish(self) -> None:
        """Does what is left here, and waits for what the other does.

        The whole waits for its parts: only the other process takes it, if it has done them all.
        """
        with self._taking:
            if self._left:
                self._left.pop()
        while (part := self._next()) is not None:
            _compile(*part)
        if self._helper:
            self._thread.join()

    def _next(self) -> Part | None:
        """What nobody has taken; None if there is no more."""
        with self._taking:
            return self._left.popleft() if self._left else None

    def _hand_out(self) -> None:
        """Gives the other process one part after the other, and tells what it compiles."""
        assert self._helper
        assert self._helper.stdin
        assert self._helper.stdout
        try:
            while True:
                name = pickle.load(self._helper.stdout)
                if name:
                    _tell(name)
                    continue
                part = self._next()
                if part is None:
                    break
                kernel, given = part
                _send(self._helper.stdin, (_name_of(kernel), given, part is self._whole))
        except (OSError, EOFError, pickle.UnpicklingError):
            pass  # what it has not done is compiled here, when it is called
        finally:
            with suppress(OSError):
                self._helper.communicate()  # closes its pipes and waits for its end


def _cores() -> int:
    """How many cores this process may run on."""
    can_ask = hasattr(os, "sched_getaffinity")
    return len(os.sched_getaffinity(0)) if can_ask else os.cpu_count() or 1


def _compile(kernel: Any, given: tuple[Any, ...], whole: bool = False) -> None:
    if whole:
        kernel.compile_of_parts(given)
    else:
        kernel.within.compile(given)


def _helper() -> subprocess.Popen[bytes] | None:
    """The other process; None if there can be none."""
    if getattr(sys, "frozen", False):  # then `executable` is the program itself
        return None
    try:
        return subprocess.Popen(
            [sys.executable, "-c", _HELP, *sys.path],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
    except OSError:
        return None


def _tell(name: str) -> None:
    """Whoever listens to Numba hears of a kernel that the other process has compiled."""
    data = {"dispatcher": _named(name)}
    numba_event.start_event(_EVENT, data=data)
    numba_event.end_event(_EVENT, data=data)


def _send(stream: IO[bytes], what: Any) -> None:
    pickle.dump(what, stream)
    stream.flush()


def _name_of(kernel: Any) -> str:
    return f"{kernel.py_func.__module__}:{kernel.py_func.__qualname__}"


def _named(name: str) -> Any:
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)


def help_out() -> None:
    """What the other process does: compiles what it is given until there is no more."""
    given, told = sys.stdin.buffer, sys.stdout.buffer
    with numba_event.install_listener(_EVENT, _Teller(told)):
        while True:
            _send(told, "")  # nothing to do
            try:
                name, types, whole = pickle.load(given)
            except EOFError:
                return
            _compile(_named(name), types, whole)


class _Teller(numba_event.Listener):
    """Says which kernel has been compiled."""

    def __init__(self, told: IO[bytes]) -> None:
        self._told = told

    def on_start(self, event: Any) -> None:
        """Nothing: it is told when it is done."""

    def on_end(self, event: Any) -> None:
        """Names it, if it is one of ours."""
        name = _name_of(event.data["dispatcher"])
        if not name.startswith("numba.") and "<locals>" not in name:
            _send(self._told, name)
