"""How a command can end: exit codes, and the error that is one line for the user."""

from __future__ import annotations

import io
import os
import shlex
import sys
from pathlib import Path

from rich.text import Text

from leaderboard.running.terminal import Terminal

EXIT_CRASHED = 1
EXIT_REFUTED = 1  # a claim does not stand
EXIT_USAGE = 2
EXIT_INTERRUPTED = 130
LONGEST_LINE = 4000  # characters that a complaint may have
EXIT_PIPE = 141  # who read the output wants no more, as the shell says it: 128 + SIGPIPE


class UsageError(Exception):
    """What the user asked for cannot be done; one line that says what to do instead."""


def complain(message: str, kind: str = "error", style: str = "red") -> None:
    """Prints one line on stderr: the kind, in a style, then the message."""
    from di_envs.files.plain_text import one_plain_line  # loads more than a list of commands needs

    line = one_plain_line(message, LONGEST_LINE)
    said = Text.assemble((kind, style), f": {line}")
    Terminal(stderr=True, soft_wrap=True, highlight=False).print(said)


def say(*lines: object) -> None:
    """Prints lines on stdout as they are: paths and commands that can be copied whole.

    Each stays one line: a name with a line break in it could say a verdict of its own.
    """
    from di_envs.files.shown_text import in_one_line  # as above

    said = (in_one_line(str(line)) for line in lines)
    Terminal().print(*said, sep="\n", highlight=False, soft_wrap=True)


def typed(argument: Path | str) -> str:
    """A path or another argument as it is typed in a shell, for commands that can be copied."""
    return shlex.quote(str(argument))


def say_what_can_be_said() -> None:
    """From here on a sign that the terminal's encoding lacks is printed as `?`; no error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors != "backslashreplace":
            stream.reconfigure(errors="replace")


def leave_pipes() -> None:
    """Writes no more to a pipe that nobody reads, so that Python can end without a word of it."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
