"""What is wrong with an agent's code or its control, in a line: whatever it raises or returns."""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from agents.base import Control
from di_envs.files.plain_text import one_plain_line

_LOW, _HIGH = (0.0, -1.0, 0.0), (1.0, 1.0, 1.0)
_CONTROL_NAMES = ("throttle", "steer", "brake")


class AgentFaultError(Exception):
    """An agent's code has failed where it ran, in another process; the text says how and where."""


class AgentDiedError(Exception):
    """The process that an agent drove in is no more; the text says what became of it."""


def describe(error: BaseException) -> str:
    """An exception and the line that raised it, in one line that is not too long."""
    if isinstance(error, AgentFaultError | AgentDiedError):
        return str(error)
    text = one_plain_line(_text_of(error))
    where, trace = "", error.__traceback__
    while trace is not None:
        where = f" at {trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}"
        trace = trace.tb_next
    name = one_plain_line(type(error).__name__)
    return f"{name}: {text}{where}" if text else f"{name}{where}"


def _text_of(error: BaseException) -> str:
    try:
        return str(error)
    except BaseException as another:  # an agent may raise what it likes, there too
        return f"(its text cannot be had: {type(another).__name__})"


@contextmanager
def agents_code() -> Iterator[None]:
    """Around code of an agent: it ends here with a process that the agent has forked.

    Raises:
        KeyboardInterrupt: If the user pressed Ctrl-C: all else that is raised is the agent's, and
            goes on as it is, but for a KeyboardInterrupt of its own, which is an
            `AgentFaultError`.
    """
    process = os.getpid()
    try:
        yield
    except KeyboardInterrupt as error:
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            raise
        raise AgentFaultError(describe(error)) from error
    finally:
        if os.getpid() != process:
            os._exit(0)  # its parent drives on, and is the one that tells


def as_control(given: Any) -> tuple[Control, str]:
    """What an agent returned as a control, and what is wrong with it; empty when nothing is.

    Whatever making an array of it raises goes on.
    """
    control = np.asarray(given, dtype=np.float32)
    return control, _control_error(control)


def _control_error(control: np.ndarray[Any, Any]) -> str:
    if control.shape != (3,):
        return f"act returned a control of shape {control.shape}, expected (3,)"
    for name, value, low, high in zip(_CONTROL_NAMES, control.tolist(), _LOW, _HIGH, strict=True):
        if not low <= value <= high:
            kind = "NaN" if math.isnan(value) else f"{value:g}, outside [{low:g}, {high:g}]"
            return f"act returned {name} {kind}"
    return ""
