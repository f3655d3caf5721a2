"""Systems by name: those of the table of agents whose driver lies in a folder of the zoo."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

import torch

from agents import AGENTS, POLICY_FILES
from agents.zoo.system import System, SystemConfig, SystemModel
from di_envs.config import check_name
from di_envs.files.json_text import JsonError

_PLACE = "agents.zoo."


def system_names() -> tuple[str, ...]:
    """The names of all systems whose network is one of the zoo's."""
    return tuple(
        name
        for name, entry in AGENTS.items()
        if entry.entry_point.startswith(_PLACE) and entry.data_files == POLICY_FILES
    )


def system_of(name: str) -> System:
    """The folder that a system is in.

    Raises:
        ValueError: If there is none; suggests the nearest.
    """
    check_name(name, system_names(), "system of the zoo")
    module = AGENTS[name].entry_point.removeprefix(_PLACE).partition(".")[0]
    found: System = importlib.import_module(f"{_PLACE}{module}").SYSTEM
    return found


def config_of(name: str) -> SystemConfig:
    """The configuration of that name.

    Raises:
        ValueError: If there is none; suggests the nearest.
    """
    return system_of(name).configs[name]


def config_from(values: Any, source: str) -> SystemConfig:
    """A configuration of JSON values, of the system that they name.

    Raises:
        JsonError: If there is no such system, or a field is refused.
    """
    name = values.get("system") if isinstance(values, Mapping) else None
    try:
        kind = type(config_of(str(name)))
    except ValueError as error:
        raise JsonError(f"{source}: {error}") from error
    return kind.from_mapping(values, source)


def network_of(config: SystemConfig) -> SystemModel:
    """Fresh weights, drawn from torch's generator."""
    network = system_of(config.system).model(config)
    # in which CPUs and GPUs convolve faster; torch's stubs do not know the argument
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return network


def recipe_of(name: str) -> str:
    """The recipe that trains a system: of several in a folder the folder's."""
    last = tuple(system_of(name).configs)[-1]
    return f"recipes/{last}.toml"
