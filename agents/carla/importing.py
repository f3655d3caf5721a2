"""Loads the file of an agent for CARLA: with what it imports of CARLA's, and its own folders first.

- `carla` is the wheel; without it, the plain values of `agents.carla.values`.
- `srunner.scenariomanager.carla_data_provider` and `.timer` are `agents.carla.data_provider`.
- `leaderboard` and `agents` are this project's, whatever lies in the agent's folders.
- NumPy has the names that it had when agents were written (`agents.carla.numpy_names`).
- Environment variables that CARLA's scripts set are there, unless they were set already.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from agents import AgentSpecError, module_of_file
from agents.carla import data_provider
from agents.carla.numpy_names import put_back
from agents.carla.values import carla_values
from agents.import_folders import import_first

_OURS = ("di_envs", "agents", "leaderboard", "wrappers")  # loaded before, so found before others
_STANDS_FOR: dict[str, dict[str, Any]] = {
    "srunner.scenariomanager.carla_data_provider": {
        "CarlaDataProvider": data_provider.CarlaDataProvider
    },
    "srunner.scenariomanager.timer": {"GameTime": data_provider.GameTime},
}
_HINTS = {
    "carla": "Install CARLA's wheel: pip install 'driveinsight[carla]'.",
    "srunner": "Of CARLA's ScenarioRunner there is scenariomanager.carla_data_provider and .timer.",
    "leaderboard": "Of CARLA's Leaderboard there is autoagents.autonomous_agent, "
    "envs.sensor_interface and utils.route_manipulation.",
    "agents": "Of CARLA's agents there is agents.navigation: basic_agent, behavior_agent, "
    "global_route_planner, local_planner.",
}


def entry_class(path: Path, config: str, folders: Sequence[Path]) -> type[Any]:
    """The class that an agent's file names as its entry point.

    Args:
        path: The file.
        config: What its `setup` is given.
        folders: From which its imports come first, before the file's own folder.

    Raises:
        AgentSpecError: If it is no such file, or imports what is not here. Whatever else its code
            raises goes on.
    """
    spec = f"carla:{path}"
    for name in _OURS:
        importlib.import_module(name)
    import_first([*folders, path.parent])  # as CARLA's scripts do: agents import what lies beside
    _stand_in()
    put_back()
    _say_environment(path, config)
    try:
        module = module_of_file(spec, path)
    except ModuleNotFoundError as error:
        hint = _HINTS.get(
            str(error.name).partition(".")[0],
            "Is it installed, or in a folder of ?path=FOLDER,FOLDER?",
        )
        raise AgentSpecError(f"agent '{spec}' imports what is not here: {error}. {hint}") from error
    named = getattr(module, "get_entry_point", None)
    if not callable(named):
        raise AgentSpecError(
            f"agent '{spec}': the file has no get_entry_point(), which returns the name of the "
            f"agent's class; for one that is written for DriveInsight give {path}:Class."
        )
    name = named()
    found = getattr(module, str(name), None)
    if not isinstance(found, type):
        raise AgentSpecError(
            f"agent '{spec}': get_entry_point() returned {name!r}, which is no class of the file."
        )
    return found


def _stand_in() -> None:
    """Puts what stands for CARLA's modules where imports find it."""
    if sys.modules.get("carla") is None and importlib.util.find_spec("carla") is None:
        sys.modules["carla"] = carla_values()
    for name, contents in _STANDS_FOR.items():
        parts = name.split(".")
        for length in range(1, len(parts) + 1):
            inner = ".".join(parts[:length])
            if inner in sys.modules:
                continue
            module: Any = ModuleType(inner)
            if length < len(parts):
                module.__path__ = []  # a package, with nothing else in it
            sys.modules[inner] = module
            if length > 1:
                setattr(sys.modules[".".join(parts[: length - 1])], parts[length - 1], module)
        sys.modules[name].__dict__.update(contents)


def _say_environment(path: Path, config: str) -> None:
    """What the scripts of the Leaderboard tell an agent by environment variables."""
    said = {
        "TEAM_AGENT": str(path),
        "TEAM_CONFIG": config,
        "ROUTES": "routes.xml",
        "SCENARIOS": "",
        "CHALLENGE_TRACK_CODENAME": "SENSORS",
        "PORT": "2000",
        "TM_PORT": "8000",
        "REPETITIONS": "1",
        "DEBUG_CHALLENGE": "0",
    }
    for name, value in said.items():
        os.environ.setdefault(name, value)
