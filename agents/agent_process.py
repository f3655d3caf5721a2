"""What a process does in which an agent of others drives: it answers for the agent, and no more.

It is sent the agent's specification, its plan and what it sees, nothing else of the world. It
answers in JSON: whoever reads a pickle runs what its writer likes, and the agent could write one.
"""

from __future__ import annotations

import faulthandler
import json
import os
import warnings
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

from agents import AgentSpecError, load_agent
from agents.base import Agent, Requirements
from agents.faults import agents_code, as_control, describe
from agents.generators import generators
from agents.processes import leave_warnings_to_parent, live_for_parent
from agents.shared_arrays import Receiver
from agents.versions import loaded_packages
from di_envs.edits.text import EditError, read_edit
from di_envs.files.plain_text import one_plain_line
from di_envs.sensors.carla_sensor import SensorSuiteError

# How a fault is called in an answer
CRASHED, REFUSED, NO_EDIT, BAD_SENSORS = "crashed", "refused", "edit", "sensors"
MOST_WARNINGS = 20  # in one answer


def serve(connection: Connection, place: int | None, where_signal: int) -> None:
    """The process's life: a command at a time, each with an answer.

    Args:
        connection: To whoever drives.
        place: Descriptor of the file into which it writes where it is when it gets `where_signal`;
            None for nowhere.
        where_signal: Number of that signal.
    """
    live_for_parent()
    faulthandler.enable()
    if place is not None and where_signal:
        faulthandler.register(where_signal, file=place, all_threads=False)
    met: list[str] = []
    warnings.simplefilter("default", UserWarning)
    leave_warnings_to_parent()  # said last, it goes before
    warnings.showwarning = lambda message, *_, **__: met.append(one_plain_line(str(message)))
    with generators() as drawn:
        hosted = _Hosted(connection, drawn.begin)
        try:
            while True:
                command, *given = connection.recv()
                answer = _answer(partial(getattr(hosted, command), *given))
                answer["warned"] = met[:MOST_WARNINGS]
                met.clear()
                connection.send_bytes(json.dumps(answer).encode())
        except (EOFError, BrokenPipeError, ConnectionResetError):
            pass  # whoever drove wants no more


def _answer(work: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What a command comes to; or what is wrong, whatever the agent's code raises."""
    try:
        with agents_code():
            return work()
    except SensorSuiteError as error:
        return {"fault": BAD_SENSORS, "text": one_plain_line(str(error))}
    except AgentSpecError as error:
        return {"fault": REFUSED, "text": one_plain_line(str(error))}
    except EditError as error:
        return {"fault": NO_EDIT, "text": one_plain_line(str(error))}
    except BaseException as error:
        return {"fault": CRASHED, "text": describe(error)}


class _Hosted:
    """The agent, and what it remembers; each method is a command."""

    def __init__(self, connection: Connection, begin: Callable[[int], None]) -> None:
        self._arrays = Receiver(connection)
        self._begin = begin
        self._folder = os.getcwd()
        self._agent: Agent[Any] | None = None
        self._memory: Any = None
        self._others: dict[str, Any] = {}

    @property
    def _made(self) -> Agent[Any]:
        assert self._agent is not None
        return self._agent

    def make(self, spec: str) -> dict[str, Any]:
        """Makes the agent, in the folder and with the random numbers that any other began with."""
        self._memory = None
        os.chdir(self._folder)
        self._begin(0)
        self._agent = load_agent(spec)
        return {"edits": hasattr(self._agent, "edited")}

    def requires(self) -> dict[str, Any]:
        """What it requires."""
        return Requirements.agreed(self._made.requires).as_json()

    def loaded(self) -> dict[str, Any]:
        """Which packages are loaded that its decisions may rest on."""
        return {"packages": loaded_packages()}

    def edited(self, texts: list[str]) -> dict[str, Any]:
        """Puts the agent, edited inside, in its own place."""
        made: Any = self._made
        self._agent = made.edited([read_edit(text) for text in texts])
        return {}

    def start(self, plan: Any, seed: int) -> dict[str, Any]:
        """A route begins."""
        self._begin(seed)
        self._memory = self._made.start(plan, seed)
        return {}

    def act(self, others: dict[str, Any]) -> dict[str, Any]:
        """A decision: three numbers of 32 bits, spelled in hexadecimal."""
        self._others |= others
        seen = {**self._arrays.receive(), **self._others}
        given, self._memory = self._made.act(seen, self._memory)
        control, wrong = as_control(given)
        return {"fault": CRASHED, "text": wrong} if wrong else {"control": control.tobytes().hex()}

    def close(self) -> dict[str, Any]:
        """Closes the agent."""
        self._made.close()
        return {}
