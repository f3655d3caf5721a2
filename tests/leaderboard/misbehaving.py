"""Agents that go wrong, each in its own way; loaded by path as a user's agent would be."""

from __future__ import annotations

import ctypes
import os
import random
import signal
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from agents.base import Requirements
from leaderboard.running.jobs import Job

FOR_EVER_S = 3600.0
LOADED_IN = Path.cwd()
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


class OwnBaseError(BaseException):
    """As no `except Exception` catches."""


class UnspeakableError(Exception):
    def __str__(self) -> str:
        raise RuntimeError("I have no text")


class InterruptsItself(Brakes):
    def misbehave(self) -> Any:
        raise KeyboardInterrupt


class LeavesAGenerator(Brakes):
    def misbehave(self) -> Any:
        raise GeneratorExit


class RaisesItsOwnBase(Brakes):
    def misbehave(self) -> Any:
        raise OwnBaseError("mine")


class RaisesWhatCannotBeSaid(Brakes):
    def misbehave(self) -> Any:
        raise UnspeakableError


class SaysFarTooMuch(Brakes):
    def misbehave(self) -> Any:
        raise ValueError("\x1b[2J" + "x" * 1_000_000)


class Forks(Brakes):
    """Both go on from here as if they were the one."""

    def misbehave(self) -> Any:
        os.fork()
        return BRAKE


class WandersOff(Brakes):
    """Leaves for another folder, and steers where it does not begin in the one it was loaded in."""

    def start(self, plan: Any, seed: int) -> int:
        self._away = Path.cwd() != LOADED_IN
        return 0

    def act(self, observation: Any, memory: int) -> tuple[Any, int]:
        os.chdir(Path.cwd().anchor)
        return np.array([0.0, float(self._away), 1.0], np.float32), memory


class ClosesStdout(Brakes):
    def misbehave(self) -> Any:
        os.close(1)
        os.close(2)
        return BRAKE


class DrawsFromAll(Brakes):
    """Steers by the generators that a process shares, and loads one of them on the way."""

    def act(self, observation: Any, memory: int) -> tuple[Any, int]:
        import torch

        drawn = random.random() + np.random.random() + float(torch.rand(1))  # noqa: NPY002
        return np.array([0.3, drawn / 3.0 - 0.5, 0.0], np.float32), memory


class LooksAround(Brakes):
    """Reaches for the true world by the frames of whoever calls it; brakes where it finds one."""

    def act(self, observation: Any, memory: int) -> tuple[Any, int]:
        frame, found = sys._getframe(), False
        while frame is not None and not found:
            found = any(hasattr(value, "world") for value in frame.f_locals.values())
            frame = frame.f_back  # type: ignore[assignment]
        return np.array([0.0, 0.0, 1.0] if found else [0.5, 0.0, 0.0], np.float32), memory


class SeesTheCamera(Brakes):
    """Steers by a sum over the picture, and keeps every picture that it was shown."""

    requires = Requirements(observations=("camera", "inertial"), options={"cameras": "rl"})

    def start(self, plan: Any, seed: int) -> Any:
        return ()

    def act(self, observation: Any, memory: Any) -> tuple[Any, Any]:
        memory = (*memory, observation["camera_front"])[-5:]
        steer = sum(int(image.sum()) for image in memory) % 1000 / 1000.0 - 0.5
        return np.array([0.4, steer, 0.0], np.float32), memory


class ChoosesItsRoutes(Brakes):
    class requires:  # noqa: N801 (as an agent might: no Requirements at all)
        observations = ("prompt",)
        control_dt_s = 0.1
        privileged = hd_map = False
        branchable = True
        options = {"traffic": 0}  # noqa: RUF012


class BecomesPrivileged(Brakes):
    """Says at first that it needs the prompt alone; once it drives, that it may see the world."""

    made = 0

    def __init__(self) -> None:
        type(self).made += 1
        self.requires = Requirements(privileged=type(self).made > 1)

    def act(self, observation: Any, memory: int) -> tuple[Any, int]:
        return np.array([0.5, 0.0, 0.0] if "world" in observation else BRAKE, np.float32), memory
