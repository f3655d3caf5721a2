"""An agent of others, driven in a process of its own: what it may not know is not there.

In the process of the world a few lines of Python reach the true world, whatever the agent's track
(`sys._getframe`). In one of its own an agent has what it is sent: its plan and its observations.
`docs/security.md` says what is possible all the same.
"""

from __future__ import annotations

import contextlib
import multiprocessing.reduction
import warnings
from collections.abc import Sequence
from functools import cached_property
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import numpy as np

from agents import AgentSpecError
from agents.agent_process import BAD_SENSORS, MOST_WARNINGS, NO_EDIT, REFUSED, serve
from agents.base import Control, Observation, Requirements
from agents.faults import AgentDiedError, AgentFaultError
from agents.processes import FRESH, births, how_it_ended, keep_others_out
from agents.shared_arrays import Sender
from di_envs.edits.text import EditError, EditText
from di_envs.files.json_text import JsonError, parsed
from di_envs.files.plain_text import one_plain_line
from di_envs.sensors.carla_sensor import SensorSuiteError
from di_envs.town.plan import RoutePlan

_LOOK_S = 0.25  # how often it is looked whether the process is still there
_LONGEST_ANSWER = 2**20  # bytes
_LONGEST_FAULT = 1000  # characters: an exception's text, and where it was raised
_RAISED = {REFUSED: AgentSpecError, NO_EDIT: EditError, BAD_SENSORS: SensorSuiteError}


class AgentProcess:
    """A process in which agents of one specification are made and drive, one after another.

    Args:
        place: Descriptor of the file into which it writes where it is when asked; None for none.
        where_signal: The signal that asks it.
    """

    def __init__(self, place: int | None = None, where_signal: int = 0) -> None:
        self._place, self._where_signal = place, where_signal
        self._process: BaseProcess | None = None
        self._connection: Connection
        self._arrays: Sender

    @property
    def id(self) -> int:
        """Of the process; 0 while there is none."""
        return (self._process.pid or 0) if self._process is not None else 0

    def start(self) -> None:
        """Starts it, if it does not run."""
        if self._process is not None and self._process.is_alive():
            return
        self.stop()
        keep_others_out()  # what the agent may not know is here
        self._connection, theirs = FRESH.Pipe()
        with births(), contextlib.closing(theirs):
            place = None
            if self._place is not None and self._where_signal:
                place = _OpenFile(self._place)
            self._process = FRESH.Process(target=serve, args=(theirs, place, self._where_signal))
            self._process.start()
        self._arrays = Sender(self._connection, self.id)

    def ask(self, *command: Any, arrays: Any = None) -> dict[str, Any]:
        """Gives it a command, and its arrays if it has some; its answer.

        Raises:
            AgentFaultError: If the agent's code fails.
            AgentDiedError: If the process ends over it.
            AgentSpecError: If the agent cannot be had.
            EditError: If it cannot be edited so.
            SensorSuiteError: If its sensors are refused.
        """
        try:
            self._connection.send(command)
            if arrays is not None:
                self._arrays.send(arrays)
            while not self._connection.poll(_LOOK_S):
                if self._process is None or not self._process.is_alive():
                    raise EOFError
            answer = _read(self._connection.recv_bytes(_LONGEST_ANSWER))
        except (EOFError, OSError) as error:
            raise AgentDiedError(f"the agent's process {self._ended()}") from error
        except BaseException:  # whatever it answers later would be taken for another answer
            self.stop()
            raise
        warned = answer.pop("warned", None)
        for text in (warned if isinstance(warned, list) else [])[:MOST_WARNINGS]:
            warnings.warn(one_plain_line(str(text)), stacklevel=3)
        if "fault" in answer:
            text = one_plain_line(str(answer.get("text")), _LONGEST_FAULT)
            raise _RAISED.get(str(answer["fault"]), AgentFaultError)(text)
        return answer

    def _ended(self) -> str:
        """How it ended; it is gone afterwards."""
        assert self._process is not None
        self._process.join(_LOOK_S)
        self._process.kill()  # one that sends what cannot be read may be there still
        self._process.join()
        ended = how_it_ended(self._process.exitcode)
        self.stop()
        return ended

    def stop(self) -> None:
        """Ends it, at once."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._connection.close()
            self._process = None


class _OpenFile:
    """A file that a process is born with: there it is the descriptor."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def __reduce__(self) -> tuple[Any, ...]:
        return _there, (multiprocessing.reduction.DupFd(self._descriptor),)


def _there(duplicate: Any) -> int:
    descriptor: int = duplicate.detach()
    return descriptor


def _read(answer: bytes) -> dict[str, Any]:
    try:
        found = parsed(answer.decode(), "the agent's process")
    except (JsonError, UnicodeDecodeError) as error:
        raise AgentFaultError(f"the agent's process answers what is no answer: {error}") from error
    if not isinstance(found, dict):
        raise AgentFaultError("the agent's process answers what is no answer")
    return found


class IsolatedAgent:
    """An agent, as whoever drives holds it; its memory stays where it is.

    The memory that is handed out is the number of decisions so far: the agent goes on from its last
    one, and cannot be branched.
    """

    def __init__(self, process: AgentProcess, spec: str) -> None:
        """Makes the agent; raises as `AgentProcess.ask`."""
        process.start()
        self._process = process
        self._edits = bool(process.ask("make", spec).get("edits"))
        self._decisions = 0
        self._others: dict[str, Any] = {}

    @cached_property
    def requires(self) -> Requirements:
        """What it requires, checked."""
        return Requirements.of_json(self._process.ask("requires"))

    def loaded(self) -> tuple[str, ...]:
        """`agents.versions.loaded_packages` of its process."""
        return tuple(map(str, self._process.ask("loaded").get("packages", ())))

    @property
    def edited(self) -> Any:
        """Makes it one that is edited inside; an AttributeError where the agent does not offer it.

        Raises:
            AttributeError: As for any object that has no such attribute.
        """
        if not self._edits:
            raise AttributeError("edited")
        return self._edited

    def _edited(self, edits: Sequence[EditText]) -> IsolatedAgent:
        self._process.ask("edited", [str(edit) for edit in edits])
        return self

    def start(self, plan: RoutePlan, seed: int) -> int:
        """Begins a route."""
        self._process.ask("start", plan, seed)
        self._decisions = 0
        return 0

    def act(self, observation: Observation, memory: int) -> tuple[Control, int]:
        """The agent's decision."""
        if memory != self._decisions:
            raise RuntimeError(
                f"an agent in a process of its own goes on from its last decision, "
                f"{self._decisions}, not from {memory}: to branch it, make it in this process"
            )
        arrays = {n: value for n, value in observation.items() if isinstance(value, np.ndarray)}
        others = {
            name: value
            for name, value in observation.items()
            if name not in arrays and self._others.get(name) is not value
        }
        self._others |= others
        answer = self._process.ask("act", others, arrays=arrays)
        self._decisions += 1
        try:
            control = np.frombuffer(bytes.fromhex(answer["control"]), np.float32)
        except (KeyError, TypeError, ValueError) as error:
            raise AgentFaultError(f"the agent's process answers no control: {error}") from error
        return control, self._decisions

    def close(self) -> None:
        """Closes the agent, if it is still there; its process stays for the next one."""
        if self._process.id:
            self._process.ask("close")
