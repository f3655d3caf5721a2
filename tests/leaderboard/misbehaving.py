"""Agents that go wrong, each in its own way; loaded by path as a user's agent would be."""

from __future__ import annotations

import os
import signal
from typing import Any

import numpy as np

from agents.base import Requirements
from leaderboard.jobs import Job

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


class InterruptsTheRun(_OnSeedTwo):
    def misbehave(self) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        return BRAKE


class TerminatesTheParent(_OnSeedTwo):
    def misbehave(self) -> Any:
        os.kill(os.getppid(), signal.SIGTERM)
        return BRAKE


class InterruptsParentAndWorker(_OnSeedTwo):
    """As Ctrl-C in a terminal does: everybody in the foreground gets the signal."""

    def misbehave(self) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getppid(), signal.SIGINT)
        return BRAKE


class KillsItsWorker(_OnSeedTwo):
    def misbehave(self) -> Any:
        os.kill(os.getpid(), signal.SIGKILL)
        return BRAKE
