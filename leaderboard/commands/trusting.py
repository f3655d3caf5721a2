"""Whose code a command may run: that of the user and ours, and others' if the user says so.

A results folder names its agent and its edits; a model of Stable-Baselines3 holds pickles. Both may
have come from anybody, so what they would run is named, with its path, and waits for `--trust`.
"""

from __future__ import annotations

import dataclasses
import hashlib
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from agents.ownership import PICKLES
from leaderboard.commands.ending import UsageError

if TYPE_CHECKING:
    from leaderboard.records.record import RunRecord

OWN_FOLDERS = ("results", "runs")  # where commands write, if nothing else is said


def trusted_run(run: RunRecord, *, agent: str | None, trust: bool) -> RunRecord:
    """A run whose agent and edits may be loaded, with the agent that the user named instead.

    Args:
        run: As read from its folder.
        agent: Named by the user; None for the one that the folder names.
        trust: Whether the user trusts what the folder names.

    Raises:
        UsageError: If it would run code of others or fetch something, and nobody said that it may.
    """
    from agents.hub import is_on_hub
    from agents.ownership import code_of_others
    from leaderboard.replaying.recorded_edits import code_of_edits

    if agent is not None:
        check_model(agent, trust=trust)
    if agent is None and not trust and is_on_hub(run.agent):
        raise UsageError(
            f"this would fetch the agent '{run.agent}' from the Hub, as the results folder asks: "
            "if that is meant, add --trust, or name it with --agent"
        )
    found = [] if agent is not None else [code_of_others(run.agent)]
    kept = [run.interventions, *(record.interventions for record in run.routes)]
    found += code_of_edits(text for texts in kept for text in texts)
    code = ", ".join(dict.fromkeys(filter(None, found)))
    if code and not trust:
        raise UsageError(
            f"this would run code that is not ours, as the results folder asks: {code}. Results "
            "may come from anybody: if you trust what it names, add --trust; if the agent is one "
            "of yours, name it with --agent"
        )
    return dataclasses.replace(run, agent=agent or run.agent)


def trusted_edits(run: RunRecord, *, trust: bool) -> None:
    """Refuses edits of a run that are code of others; its agent is not asked for.

    Raises:
        UsageError: If there are some, and nobody said that they may run.
    """
    trusted_run(run, agent="expert", trust=trust)


def check_model(agent: str, *, trust: bool) -> None:
    """Refuses a model with pickles that is not the user's own, the first time.

    Args:
        agent: An agent's specification.
        trust: Whether the user trusts it; that is remembered, by what the file holds.

    Raises:
        UsageError: If nobody has said so.
    """
    scheme, _, place = agent.partition(":")
    path = Path(place.partition("?")[0])
    if scheme not in PICKLES or not path.is_file() or _is_own(path):
        return
    from di_envs.files.caches import cache_folders

    mark = hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()
    if trust:
        _remember(mark)
    elif not any((folder / mark).exists() for folder in cache_folders("trusted")):
        raise UsageError(
            f"{path.absolute()} holds pickles, and loading it runs the code in them. If you "
            "trained it, or trust who did, add --trust; it is remembered for this very file"
        )


def _is_own(path: Path) -> bool:
    """Whether a file is where our commands put what the user makes."""
    here = Path.cwd()
    return any(path.resolve().is_relative_to((here / name).resolve()) for name in OWN_FOLDERS)


def _remember(mark: str) -> None:
    """Keeps that a file with such bytes is trusted, in a folder that only the user can write."""
    from di_envs.files.caches import writable_cache

    folder = writable_cache("trusted")
    if folder is not None:
        with suppress(OSError):  # then it is asked again
            (folder / mark).touch()
