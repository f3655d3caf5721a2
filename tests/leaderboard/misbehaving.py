"""Agents that go wrong, each in its own way; loaded by path as a user's agent would be."""

from __future__ import annotations

import ctypes
import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np

from agents.base import Requirements
from leaderboard.running.jobs import Job

FOR_EVER_S = 3600.0
BRAKE = np.array([0.0, 0.0, 1.0], dtype=np.float32)


class Brakes:
    """Stands still: well behaved, but for what the classes below do after `LIMIT` decisions."""

    requires = Requirements()
    LIMIT = 5

    def start(self, plan: Any, seed: int) -> int:
        return 0

    def act(self, observation: Any, memory: int) -> tuple[Any, int]:
        if memory == self.LIMIT:
            return self.misbehave(), memory + 1
        return np.array([0.5, 0.0, 0.0], dtype=np.float32), memory + 1

    def misbehave(self) -> Any:
        return BRAKE

    def close(self) -> None:
        pass


class Raises(Brakes):
    def misbehave(self) -> Any:
        raise KeyError("no such lane")


class Exits(Brakes):
    def misbehave(self) -> Any:
        raise SystemExit(3)


class ReturnsNan(Brakes):
    def misbehave(self) -> Any:
        return np.array([0.0, np.nan, 0.0], dtype=np.float32)


class LeavesTheActionSpace(Brakes):
    def misbehave(self) -> Any:
        return [1.5, 0.0, 0.0]


class ReturnsTheWrongShape(Brakes):
    def misbehave(self) -> Any:
        return [0.0, 0.0]


class ReturnsText(Brakes):
    def misbehave(self) -> Any:
        return "brake"


class FailsAtStart(Brakes):
    def start(self, plan: Any, seed: int) -> int:
        raise RuntimeError("no weights")


class Dawdles(Brakes):
    """No step is long, but there is no end to them."""

    def act(self, observation: Any, memory: int) -> tuple[Any, int]:
        time.sleep(0.1)
        return BRAKE, memory


class ReturnsNone(Brakes):
    def act(self, observation: Any, memory: int) -> Any:
        return None


class Sleeps(Brakes):
    def misbehave(self) -> Any:
        time.sleep(FOR_EVER_S)


class SleepsWithPythonsLock(Brakes):
    """As a library does that computes for ever without letting Python go."""

    def misbehave(self) -> Any:
        ctypes.PyDLL(None).sleep(int(FOR_EVER_S))


class SleepsAtStart(Brakes):
    def start(self, plan: Any, seed: int) -> int:
        time.sleep(FOR_EVER_S)
        return 0


class SleepsWhenMade(Brakes):
    def __init__(self) -> None:
        time.sleep(FOR_EVER_S)


class RaisesWhenMade(Brakes):
    def __init__(self) -> None:
        raise OSError("no weights")


class EndsItsProcessWhenMade(Brakes):
    def __init__(self) -> None:
        os._exit(7)


class EndsItsProcess(Brakes):
    def misbehave(self) -> Any:
        os._exit(7)


class Segfaults(Brakes):
    def misbehave(self) -> Any:
        ctypes.string_at(0)


class FailsToClose(Brakes):
    def close(self) -> None:
        raise RuntimeError("already closed")


class _OnSeedTwo(Brakes):
    """Does something to a process when it meets the seed 2 (but not when warming up)."""

    def start(self, plan: Any, seed: int) -> int:
        marked = Job(index=0, route_id=plan.route_id, seed=2).world_seed
        return 0 if seed == marked else self.LIMIT + 1


class RaisesOnSeedTwo(_OnSeedTwo):
    def misbehave(self) -> Any:
        raise ValueError("I do not like this seed")


class TerminatesTheRun(_OnSeedTwo):
    def misbehave(self) -> Any:
        os.kill(os.getppid(), signal.SIGTERM)
        time.sleep(FOR_EVER_S)


class InterruptsTheRun(_OnSeedTwo):
    """As Ctrl-C in a terminal does: everybody in the foreground gets the signal."""

    def misbehave(self) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getppid(), signal.SIGINT)
        time.sleep(FOR_EVER_S)


class KillsItsWorker(_OnSeedTwo):
    def misbehave(self) -> Any:
        os.kill(os.getpid(), signal.SIGKILL)
        return BRAKE


class KillsItsWorkerOnce(_OnSeedTwo):
    """A fault that comes and goes, as of a machine: a file beside this one remembers it."""

    def misbehave(self) -> Any:
        if _first_time("worker-killed"):
            os.kill(os.getpid(), signal.SIGKILL)
        return BRAKE


class KillsItsParentThenItself(_OnSeedTwo):
    """The same for an actor of Ray's, which is what holds a worker there."""

    def misbehave(self) -> Any:
        if _first_time("parent-killed"):
            os.kill(os.getppid(), signal.SIGKILL)
            time.sleep(FOR_EVER_S)
        return BRAKE


def _first_time(name: str) -> bool:
    mark = Path(__file__).with_name(name)
    known = mark.exists()
    mark.touch()
    return not known
