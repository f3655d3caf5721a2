"""What is wrong with a request that was made in Python, in the words of Python."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from di_envs.edits.text import EditError
from leaderboard.commands.ending import UsageError
from leaderboard.explaining.explanation import ExplainError
from leaderboard.pages.report_page import ReportError
from leaderboard.records.chosen_route import RouteChoiceError
from leaderboard.records.results import ResultsError
from leaderboard.replaying.branch import BranchError
from leaderboard.replaying.recorded_agent import RetraceError
from leaderboard.replaying.replay import ReplayError
from leaderboard.running.jobs import SetupError
from leaderboard.studies import StudyError
from leaderboard.studies.comparing import PairingError

_WRONG = (
    *(UsageError, SetupError, ResultsError, StudyError, PairingError, RouteChoiceError),
    *(EditError, ExplainError, BranchError, ReplayError, ReportError, RetraceError, ValueError),
)
_OPTION = re.compile(r"--([a-z]+(?:-[a-z]+)*)")
_FLAGS = frozenset({"trust", "resume", "overwrite", "strict"})
_CALLED = {"route-ids": "routes", "routes": "route_file"}  # otherwise than options


class RequestError(ValueError):
    """What was asked for cannot be done; the message says what to do instead."""


@contextmanager
def requests() -> Iterator[None]:
    """Within, whatever is wrong with what was asked for is a `RequestError`.

    Raises:
        RequestError: If something is.
    """
    try:
        yield
    except RequestError:
        raise
    except _WRONG as error:
        raise RequestError(in_python(str(error))) from error


def in_python(text: str) -> str:
    """A text in which options of the commands are arguments: `--trust` is `trust=True`."""

    def argument(found: re.Match[str]) -> str:
        name = _CALLED.get(found[1], found[1].replace("-", "_"))
        return f"{name}=True" if found[1] in _FLAGS else f"{name}="

    return _OPTION.sub(argument, text)
