"""Tells of kernels as they are compiled: by the first run of a version, for half a minute."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event as numba_event
from rich.console import Console

from di_envs.numerics.kernels import kernel_sources
from leaderboard.running.displays.compile_bar import CompileBar
from leaderboard.running.displays.work_bar import EACH, work_bar
from leaderboard.running.messages import Compiling


@contextmanager
def compile_events(tell: Callable[[Compiling], None]) -> Iterator[None]:
    """Tells of each kernel compiled within; of none when all come from the cache."""
    with numba_event.install_listener("numba:compile", _Listener(tell)):
        yield


@contextmanager
def compile_progress(console: Console) -> Iterator[None]:
    """Shows a bar once a kernel is compiled within; nothing if all come from the cache."""
    bars = work_bar(EACH, console=console)
    bar = CompileBar(bars)
    try:
        with compile_events(bar.show):
            yield
    finally:
        bar.fill()
        if bars.live.is_started:
            bars.stop()


class _Listener(numba_event.Listener):
    """Counts Numba's compile events."""

    def __init__(self, tell: Callable[[Compiling], None]) -> None:
        self._tell, self._done, self._total = tell, 0, 0

    def on_start(self, event: Any) -> None:
        self._total = self._total or _kernel_count()
        name = event.data["dispatcher"].py_func.__name__
        self._tell(Compiling(kernel=name, done=self._done, total=self._total))

    def on_end(self, event: Any) -> None:
        self._done += 1


def _kernel_count() -> int:
    texts = (path.read_text(encoding="utf-8") for path in kernel_sources())
    return sum(len(re.findall(r"^@kernel", text, flags=re.MULTILINE)) for text in texts)
