"""An agent as it is given in Python: by its name, as a class, or as an instance."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agents import AGENTS
from agents.base import Agent
from agents.pickled import agent_name, keep_agent
from leaderboard.api.requests import RequestError

GivenAgent = str | type | Agent[Any]
_METHODS = ("start", "act", "close")


def name_of(agent: GivenAgent) -> str:
    """What it is called, for a folder's name."""
    return agent if isinstance(agent, str) else agent_name(agent)


def specification_of(agent: GivenAgent, folder: Path) -> str:
    """What names the agent in every process.

    Args:
        agent: A name stays what it is; one of our own classes is named; any other class or
            instance is kept in a file.
        folder: Where that file goes.

    Raises:
        RequestError: If it is no agent, or cannot be kept.
    """
    if isinstance(agent, str):
        return agent
    if isinstance(agent, type):
        ours = f"{agent.__module__}:{agent.__qualname__}"
        if any(entry.entry_point == ours for entry in AGENTS.values()):
            return ours
    missing = [name for name in _METHODS if not callable(getattr(agent, name, None))]
    if not isinstance(agent, type) and not hasattr(agent, "requires"):
        missing.insert(0, "requires")
    if missing:
        raise RequestError(
            f"{agent_name(agent)} is no agent, it lacks {', '.join(missing)}: give a class or an "
            "instance that has requires, start, act and close (see agents/base.py), or a name"
        )
    try:
        return keep_agent(agent, folder)
    except (ValueError, OSError) as error:
        raise RequestError(str(error)) from error
