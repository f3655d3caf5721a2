"""Ctrl-C, SIGTERM and SIGQUIT ask a run to stop, so that it saves what it has; a second ends it.

The first signal raises no exception, which could come between a route's end and its file: it is
noted, and whoever works looks at `requested` now and then. The second one ends a command's process.
A process that called us from Python is not ours to end: its caller gets a `KeyboardInterrupt`.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

# Windows has no SIGQUIT
SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGQUIT") if hasattr(signal, name)
)
_SHOW_CURSOR = "\x1b[?25h"  # a progress bar hides it


class Interruption:
    """Whether the run was asked to stop."""

    def __init__(self, *, ends_process: bool = False) -> None:
        self.requested = False
        self._ends_process = ends_process

    def handle(self, number: int, frame: FrameType | None) -> None:
        """A signal's handler."""
        if self.requested:
            if not self._ends_process:
                raise KeyboardInterrupt
            for child in multiprocessing.active_children():
                child.kill()
            if sys.stderr.isatty():
                os.write(sys.stderr.fileno(), _SHOW_CURSOR.encode())
            os._exit(128 + number)
        self.requested = True


@contextmanager
def interruptible(*, ends_process: bool = False) -> Iterator[Interruption]:
    """Within, signals ask for the run to stop; in the main thread, which alone gets them.

    Within another `interruptible` it is the same one: who asks a run to stop asks the study, too.

    Args:
        ends_process: Whether a second signal ends the process, which is a command's own.

    Raises:
        KeyboardInterrupt: At a second signal, if it is not.
    """
    outer = getattr(signal.getsignal(signal.SIGINT), "__self__", None)
    if isinstance(outer, Interruption):
        yield outer
        return
    interruption = Interruption(ends_process=ends_process)
    if threading.current_thread() is not threading.main_thread():
        yield interruption
        return
    before = {number: signal.signal(number, interruption.handle) for number in SIGNALS}
    try:
        yield interruption
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
