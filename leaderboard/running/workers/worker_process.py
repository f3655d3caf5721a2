"""A worker process as its parent holds it: it gets jobs, tells of them, and can be killed."""

from __future__ import annotations

import contextlib
import os
import re
import tempfile
import time
from multiprocessing.connection import Connection
from pathlib import Path

from agents.base import Requirements
from agents.processes import FRESH, births, how_it_ended
from leaderboard.records.record import OUT_OF_TIME, WORKER_DIED
from leaderboard.running.jobs import Job, RunSpec
from leaderboard.running.messages import Died, WorkerMessage
from leaderboard.running.wall_clock import CELLS, WHERE_SIGNAL, Doing, Limits, Stopwatch
from leaderboard.running.workers.worker import serve

_WHERE_S = 1.0  # for a hanging worker to write down where it is
_FRAME = re.compile(r'File "(.+)", line (\d+) in (\S+)')


class WorkerProcess:
    """A fresh process that drives jobs of one run."""

    def __init__(self, spec: RunSpec, limits: Limits) -> None:
        """Starts it; it begins when it is told to."""
        self._limits = limits
        self._dead = False
        cells = FRESH.RawArray("d", CELLS)
        self._watch = Stopwatch(cells)
        self._watch.mark(Doing.LOADING)
        self._where = tempfile.NamedTemporaryFile(  # noqa: SIM115 (closed by `stop`)
            "r", prefix="driveinsight-", delete=False
        )
        self.connection: Connection
        self.connection, theirs = FRESH.Pipe()
        self._process = FRESH.Process(
            target=serve, args=(theirs, cells, spec, Path(self._where.name))
        )
        with births(), contextlib.closing(theirs):
            self._process.start()

    @property
    def sentinel(self) -> int:
        """What `multiprocessing.connection.wait` can wait for: the end of the process."""
        return self._process.sentinel

    def begin(self, requires: Requirements | None) -> None:
        """Lets it set up the run, once: with what the agent requires, or to find that out."""
        self._send(requires)

    def hand_over(self, job: Job) -> None:
        """Gives it a job to drive."""
        self._send(job)

    def _send(self, value: object) -> None:
        with contextlib.suppress(OSError):  # a dead worker shows as such when it is asked
            self.connection.send(value)

    def receive(self) -> list[WorkerMessage]:
        """What it has told since it was last asked; `Died` last, if it is dead or is killed now."""
        if self._dead:
            return []
        messages: list[WorkerMessage] = []
        alive = self._process.is_alive()  # asked first: what it says last is then in the pipe
        try:
            while self.connection.poll():
                messages.append(self.connection.recv())
        except (EOFError, OSError):
            alive = False
        if not alive:
            messages.append(self._end(WORKER_DIED, ""))
        elif not messages and (overdue := self._watch.overdue(self._limits)):
            messages.append(self._end(OUT_OF_TIME, overdue + self._whereabouts()))
        return messages

    def _end(self, status: str, reason: str) -> Died:
        if reason:
            self._process.kill()
        self._process.join()
        self._dead = True
        return Died(
            status=status, reason=reason or f"the worker {how_it_ended(self._process.exitcode)}"
        )

    def _whereabouts(self) -> str:
        """Where in the code it hangs, as it says itself; Python need not run for that."""
        pid = self._watch.agent_process or self._process.pid
        if pid is None or not WHERE_SIGNAL:
            return ""
        with contextlib.suppress(OSError):
            os.kill(pid, WHERE_SIGNAL)
            until_s = time.monotonic() + _WHERE_S
            text = ""
            while time.monotonic() < until_s:
                text += self._where.read()
                frame = _FRAME.search(text)
                if frame:
                    return f" (in {frame[3]} at {frame[1]}:{frame[2]})"
                time.sleep(0.02)
        return ""

    def stop(self) -> None:
        """Ends it, at once."""
        self._process.kill()
        self._process.join()
        self.connection.close()
        self._where.close()
        Path(self._where.name).unlink(missing_ok=True)
