"""Agents from a notebook: a class or an instance in a file, with all that it refers to.

Where an agent drives it is made by its name, and a class that was typed into a cell has none that
another process could find. So its code goes into a file, by value, and the file is its name:
`pickled:FILE`. Loading one runs the code in it, as with any pickle.
"""

from __future__ import annotations

import hashlib
import pickle
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import cloudpickle

from agents import AgentSpecError
from di_envs.files.plain_text import file_name
from di_envs.files.whole import write_whole

SUFFIX = ".pickle"


class PickledAgent:
    """What `pickled:FILE` makes: the agent that is in the file, or one of the class that is."""

    def __new__(cls, path: str) -> Any:
        """Makes it anew from the file, so that nothing of one route is left for the next."""
        place = Path(path)
        if not place.is_file():
            raise AgentSpecError(f"agent 'pickled:{path}': there is no file {place.absolute()}.")
        given = pickle.loads(place.read_bytes())
        return given() if isinstance(given, type) else given


def keep_agent(agent: Any, folder: Path) -> str:
    """Puts an agent into a file, which is named by what it holds; returns its specification.

    Args:
        agent: A class that is made without arguments, or an instance.
        folder: Where the file goes; made if need be.

    Raises:
        ValueError: If it cannot be pickled.
        OSError: If the file cannot be written.
    """
    name = agent_name(agent)
    try:
        with _by_value(_class_of(agent)):
            content = cloudpickle.dumps(agent)
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        raise ValueError(
            f"{name} cannot be handed to the process that drives it: {error}. Give the class in "
            "place of the instance, and open files, sessions and the like in `__init__` or `start`"
        ) from error
    digest = hashlib.blake2b(content, digest_size=4).hexdigest()
    path = folder / f"{file_name(name)}-{digest}{SUFFIX}"
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(path, content)
    return f"pickled:{path}"


def agent_name(agent: Any) -> str:
    """What an agent is called: its class."""
    return _class_of(agent).__name__


def _class_of(agent: Any) -> type:
    return agent if isinstance(agent, type) else type(agent)


@contextmanager
def _by_value(kind: type) -> Iterator[None]:
    """Within, the class is pickled with its code, even if a module of the user's own has it."""
    module = sys.modules.get(kind.__module__)
    if module is None or kind.__module__ == "__main__" or _is_installed(module):
        yield
        return
    cloudpickle.register_pickle_by_value(module)
    try:
        yield
    finally:
        cloudpickle.unregister_pickle_by_value(module)


def _is_installed(module: ModuleType) -> bool:
    """Whether a module is ours or of a package, and so is found by its name in any process."""
    origin = getattr(module, "__file__", None)
    if origin is None:
        return True
    ours = Path(__file__).resolve().parent
    places = (
        ours,
        *(Path(sysconfig.get_paths()[name]).resolve() for name in ("purelib", "stdlib")),
    )
    return any(Path(origin).resolve().is_relative_to(place) for place in places)
