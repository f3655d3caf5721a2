"""Folders from which an agent's imports come first: in the process that loads it, and in no other.

A published repository may bring packages that are called as ours are. Where an agent is loaded ours
are there already; a process that is born later would find the others.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

_first: list[str] = []  # those that were put into sys.path, which is the process's, too


def import_first(folders: Sequence[Path]) -> None:
    """Imports look into these first, in this order; those that Python knew stay where they are."""
    for folder in reversed([str(folder.resolve()) for folder in folders]):
        if folder not in sys.path:
            sys.path.insert(0, folder)
            _first.append(folder)


def path_without_agents() -> list[str]:
    """Where Python looks for modules, without the folders of agents."""
    return [place for place in sys.path if place not in _first]


@contextmanager
def without_agents() -> Iterator[None]:
    """Who starts processes within hands them no folder of an agent's."""
    before = list(sys.path)
    sys.path[:] = path_without_agents()
    try:
        yield
    finally:
        sys.path[:] = before
