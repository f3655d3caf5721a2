"""Reads what names an agent, a name of the table or a place in code, and makes it."""

from __future__ import annotations

import difflib
import hashlib
import importlib
import importlib.util
import inspect
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from agents.table import AGENTS, SCHEMES, AgentEntry

if TYPE_CHECKING:
    from agents.base import Agent

# Packages that not everybody has, and the extra that brings each
_EXTRAS = {"torch": "policy", "safetensors": "policy", "stable_baselines3": "rl"}

_CONTRACT = ("requires", "start", "act", "close")


class AgentSpecError(ValueError):
    """An agent specification that names nothing, or something that is no agent."""


def load_agent(spec: str, **options: Any) -> Agent[Any]:
    """Makes the agent that `spec` names.

    Args:
        spec: A name of `AGENTS`, or `module:Class`, or `path/to/file.py:Class`, or
            `scheme:file` with a scheme of `SCHEMES`; a name and a file may be followed by
            `?option=value&option=value`.
        options: Keyword arguments of the agent's class; they override the table's.

    Raises:
        AgentSpecError: If the name, module, file or class is unknown, or the class is no agent.
    """
    name, said = named(spec)
    if name in AGENTS:
        entry = AGENTS[name]
        return _ours(spec, entry, {**entry.options, **said, **options})
    scheme, _, place = spec.partition(":")
    if scheme in SCHEMES:
        entry = SCHEMES[scheme]
        path, said = place_and_options(spec, place)
        if entry.argument in said:
            raise AgentSpecError(
                f"agent '{spec}': the {entry.argument} stands before the '?', not behind it."
            )
        given = {entry.argument: path, **said, **options}
        return _ours(spec, entry, {**entry.options, **given})
    if ":" not in spec:
        raise AgentSpecError(_unknown_name(name))
    return _make(spec, spec, options)


def named(spec: str) -> tuple[str, dict[str, str]]:
    """A name of the table, and what is said of it: `interfuser?rules=off`, as of files.

    Raises:
        AgentSpecError: If what is said is not option=value.
    """
    return (spec, {}) if ":" in spec else place_and_options(spec, spec)


def place_and_options(spec: str, place: str) -> tuple[str, dict[str, str]]:
    """A file and what is said of it: `weights.zip?device=cpu` is `weights.zip`, device: cpu.

    Args:
        spec: The whole specification, for the error.
        place: What follows the scheme's colon.

    Raises:
        AgentSpecError: If what is said is not option=value.
    """
    path, _, query = place.partition("?")
    options = dict(part.partition("=")[::2] for part in query.split("&") if part)
    for name, value in options.items():
        if not name.isidentifier() or not value:
            raise AgentSpecError(
                f"agent '{spec}': expected option=value after the '?', joined by '&'; got "
                f"'{query}'."
            )
    return path, options


def _ours(spec: str, entry: AgentEntry, options: Mapping[str, Any]) -> Agent[Any]:
    """An agent of the tables; says which extra brings a package that it lacks."""
    try:
        return _make(spec, entry.entry_point, options)
    except ModuleNotFoundError as error:
        if error.name not in _EXTRAS:
            raise
        raise AgentSpecError(
            f"agent '{spec}' needs {error.name}, which is not installed: pip install "
            f"'driveinsight[{_EXTRAS[error.name]}]'."
        ) from error


def _make(spec: str, entry_point: str, options: Mapping[str, Any]) -> Agent[Any]:
    place, _, class_name = entry_point.rpartition(":")
    module = module_of(spec, place)
    found = getattr(module, class_name, None)
    if not isinstance(found, type):
        known = [name for name, value in vars(module).items() if _defined_in(module, value)]
        raise AgentSpecError(
            f"agent '{spec}': {place} has no class '{class_name}'; {_hint(class_name, known)}"
        )
    _check_options(spec, found, options)
    agent: Agent[Any] = found(**options)
    # on the class first: what an agent requires may take it long to find out
    missing = [n for n in _CONTRACT if not hasattr(found, n) and not hasattr(agent, n)]
    if missing:
        raise AgentSpecError(
            f"agent '{spec}': {class_name} lacks {', '.join(missing)}; an agent has "
            f"{', '.join(_CONTRACT)} (see agents/base.py)."
        )
    return agent


def _check_options(spec: str, found: type, options: Mapping[str, Any]) -> None:
    parameters = inspect.signature(found).parameters
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values()):
        return
    for name in options:
        if name not in parameters:
            raise AgentSpecError(
                f"agent '{spec}': there is no option '{name}'; {_hint(name, list(parameters))}"
            )


def module_of(spec: str, place: str) -> ModuleType:
    """The module of a name, or of a Python file.

    Args:
        spec: The agent's specification, for the error.
        place: `package.module`, or `path/to/file.py`.

    Raises:
        AgentSpecError: If there is none. Whatever the module's own code raises goes on.
    """
    if place.endswith(".py"):
        return module_of_file(spec, Path(place))
    try:
        return importlib.import_module(place)
    except ModuleNotFoundError as error:
        if error.name is None or not (place + ".").startswith(error.name + "."):
            raise  # the module is there, something that it imports is not
        said = f"agent '{spec}': no module '{error.name}'"
        if spec.partition(":")[0] not in SCHEMES:  # perhaps no module was meant
            said += "; expected a name, module:Class or path/to/file.py:Class. "
            said += _unknown_name(place)
        raise AgentSpecError(said) from None


def module_of_file(spec: str, path: Path) -> ModuleType:
    """Imports a Python file, once.

    Raises:
        AgentSpecError: If there is none. Whatever the file's own code raises goes on.
    """
    if not path.is_file():
        raise AgentSpecError(f"agent '{spec}': there is no file {path.absolute()}.")
    path = path.resolve()
    # Named after the path, so that two files of the same name do not replace each other.
    name = f"agent_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    if name in sys.modules:
        return sys.modules[name]
    module_spec = importlib.util.spec_from_file_location(name, path)
    if module_spec is None or module_spec.loader is None:
        raise AgentSpecError(f"agent '{spec}': {path} cannot be imported as a Python module.")
    module = importlib.util.module_from_spec(module_spec)
    sys.modules[name] = module
    try:
        module_spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _defined_in(module: ModuleType, value: object) -> bool:
    return isinstance(value, type) and value.__module__ == module.__name__


def _unknown_name(name: str) -> str:
    return f"unknown agent '{name}'; {_hint(name, list(AGENTS))}"


def _hint(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1)
    start = f"did you mean '{near[0]}'? " if near else ""
    return f"{start}known: {', '.join(known) or 'none'}."
