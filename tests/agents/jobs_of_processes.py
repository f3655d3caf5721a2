"""Jobs for processes in tests: functions of a module, as processes find them by their names."""

from __future__ import annotations

import os
import signal
import sys
import time

from agents.processes import in_order, processes


def squared(number: int) -> int:
    """The even ones take longer than those that come after them."""
    if number % 2 == 0:
        time.sleep(0.2)
    return number * number


def squared_with_variables(number: int) -> tuple[int, str | None]:
    """The square, and what a process that is started there would be told of safe paths."""
    return number * number, os.environ.get("PYTHONSAFEPATH")


def three_has_no_square(number: int) -> int:
    if number == 3:
        raise ValueError("there is no square of 3")
    return squared(number)


def two_dies(number: int) -> int:
    if number == 2:
        os._exit(7)
    return number


def interrupted(number: int) -> int:
    """As Ctrl-C in a terminal, which is for everybody in the foreground."""
    os.kill(os.getpid(), signal.SIGINT)
    return number


_held = []


def hold(job: tuple[str, bool]) -> None:
    """Has a pipe open for as long as this process lives, idle or busy."""
    pipe, busy = job
    _held.append(os.open(pipe, os.O_WRONLY))
    os.write(_held[0], b"x")
    if busy:
        sum(range(10**10))  # for minutes, and no other thread of Python runs meanwhile


if __name__ == "__main__":  # to be killed by a test, with one child idle and one at work
    with processes(2) as pool:
        for _ in in_order(pool, hold, [(sys.argv[1], busy) for busy in (False, True)], ahead=2):
            pass
