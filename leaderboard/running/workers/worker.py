"""What a worker process does: set the run up, then drive one job after another till told to end.

It tells its parent all that happens in `messages`; Ctrl-C and the parent's end are as for every
child, see `agents.processes`.
"""

from __future__ import annotations

import faulthandler
import threading
import warnings
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from agents.processes import leave_warnings_to_parent, live_for_parent
from leaderboard.running.jobs import Job, RunSpec, SetupError
from leaderboard.running.wall_clock import WHERE_SIGNAL, Doing, Stopwatch


def serve(connection: Connection, cells: Any, spec: RunSpec, where: Path) -> None:
    """A worker's life.

    Args:
        connection: To the parent, which first sends what the agent requires (None for the worker
            that is to find that out), then jobs.
        cells: Of its `Stopwatch`.
        spec: The run.
        where: File into which it writes where it is when it gets `WHERE_SIGNAL`.
    """
    faulthandler.enable()  # a crash inside a library says on stderr which line led to it
    with open(where, "w", encoding="utf-8") as place:
        with suppress(OSError):  # Windows removes no file that is open
            where.unlink()  # the parent has it open: nothing is left behind, whatever happens
        if WHERE_SIGNAL:
            faulthandler.register(WHERE_SIGNAL, file=place, all_threads=False)
        live_for_parent()
        watch = Stopwatch(cells, place=place.fileno())
        try:
            _work(connection, watch, spec)
        except (EOFError, BrokenPipeError, ConnectionResetError):
            pass  # the parent wants no more
        finally:
            if WHERE_SIGNAL:
                faulthandler.unregister(WHERE_SIGNAL)


def _work(connection: Connection, watch: Stopwatch, spec: RunSpec) -> None:
    tell = _teller(connection)
    watch.mark(Doing.LOADING)

    from leaderboard.running.compiling import compile_events
    from leaderboard.running.messages import Compiling, Driven, Ready, Refused, Warned
    from leaderboard.running.setting_up import run_facts, set_up

    def compiling(event: Compiling) -> None:
        watch.lap()  # each kernel has the whole time
        tell(event)

    def moved() -> None:
        tell(Compiling())  # the first step has run them all

    watch.mark(Doing.WAITING)
    requires = connection.recv()
    with compile_events(compiling), warnings.catch_warnings():
        warnings.simplefilter("default", UserWarning)
        leave_warnings_to_parent()  # said last, it goes before
        warnings.showwarning = lambda message, *_, **__: tell(Warned(text=str(message)))
        try:
            driver = set_up(spec, watch, requires)
        except SetupError as error:
            tell(Refused(reason=str(error)))
            return
        tell(Ready(scene=run_facts(driver)))
        with driver:
            while True:
                watch.mark(Doing.WAITING)
                job: Job = connection.recv()
                tell(Driven(job=job, record=driver.drive(job, moved)))


def _teller(connection: Connection) -> Callable[[Any], None]:
    """Sends messages from any thread, each whole."""
    lock = threading.Lock()

    def tell(message: Any) -> None:
        with lock:
            connection.send(message)

    return tell
