"""How a command can end: exit codes, and the error that is one line for the user."""

from __future__ import annotations

from rich.markup import escape

from leaderboard.running.terminal import Terminal

EXIT_CRASHED = 1
EXIT_REFUTED = 1  # a claim does not stand
EXIT_USAGE = 2
EXIT_INTERRUPTED = 130
LONGEST_LINE = 4000  # characters that a complaint may have


class UsageError(Exception):
    """What the user asked for cannot be done; one line that says what to do instead."""


def complain(message: str, kind: str = "[red]error[/red]") -> None:
    """Prints one line on stderr: the kind, then the message."""
    from di_envs.files.plain_text import one_plain_line  # loads more than a list of commands needs

    line = one_plain_line(message, LONGEST_LINE)
    Terminal(stderr=True, soft_wrap=True, highlight=False).print(f"{kind}: {escape(line)}")


def say(*lines: object) -> None:
    """Prints lines on stdout as they are: paths and commands that can be copied whole."""
    Terminal().print(*lines, sep="\n", highlight=False, soft_wrap=True, markup=False)
