"""Whose code an agent is: ours, which is shipped and told by its version, or that of others.

Code of others drives in a process of its own, and runs from a results folder only if somebody says
that it may. Nothing here imports what it names.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

from agents import AGENTS, SCHEMES

# The schemes that name no code: files of numbers and text (policies of ours, systems of the zoo),
# and what a person drives by
_NO_CODE = ("driveinsight", "zoo", "human")
PICKLES = ("sb3", "pickled")  # those whose files run code as they are loaded
_OURS = {*AGENTS, *(entry.entry_point for entry in AGENTS.values())}


def code_of_others(spec: str) -> str:
    """What code that is not ours an agent's specification runs, in a few words; empty if none."""
    scheme, _, place = spec.partition(":")
    if spec in _OURS or not place or scheme in _NO_CODE:
        return ""
    if scheme in PICKLES:
        return f"the pickles in {_file_of(place)}"
    if scheme == "llm":
        return code_at(module_named(place))
    if scheme in SCHEMES:
        return f"the file {_file_of(place)}{_beside(place)}"
    return code_at(spec.rpartition(":")[0])


def module_named(place: str) -> str:
    """The module, or the Python file, of `module:function?option=value`."""
    return place.partition("?")[0].rpartition(":")[0]


def code_at(place: str) -> str:
    """A module's name or a Python file as a person can find it: with its path, where there is one.

    Args:
        place: `package.module`, or `path/to/file.py`.
    """
    if place.endswith(".py"):
        return f"the file {Path(place).absolute()}"
    try:
        found = importlib.util.find_spec(place.partition(".")[0])  # of a package: not imported
    except (ImportError, ValueError):
        found = None
    where = f" ({found.origin})" if found is not None and found.origin else ""
    return f"the module {place}{where}"


def _beside(place: str) -> str:
    """Folders from which a file imports besides, by its option `path`; empty without."""
    said = place.partition("?")[2].split("&")
    folders = [part.partition("=")[2] for part in said if part.startswith("path=")]
    paths = [str(Path(folder).absolute()) for text in folders for folder in text.split(",")]
    return f", and what it imports from {', '.join(paths)}" if paths else ""


def _file_of(place: str) -> Path:
    return Path(place.partition("?")[0]).absolute()
