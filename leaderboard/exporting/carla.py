"""Writes a folder with which an agent of ours drives in the CARLA Leaderboard."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import agents
from agents import AGENTS, SCHEMES, AgentSpecError, load_agent, named, place_and_options
from agents.base import Track
from agents.carla.exported.sensors import TRUTHS, sensors_of, ticks_a_decision, told_by
from di_envs.files.whole import whole_folder

# The file that drives there, as it is: it imports CARLA's packages, so nobody here imports it
SOURCE = Path(__file__).with_name("carla_file.py")
AGENT_FILE, SETTINGS_FILE, CARRIED = "agent.py", "agent.json", "policy"
FORMAT = 1  # of the settings, which that file refuses if they are of another


@dataclass(frozen=True, kw_only=True)
class Exported:
    """What was written.

    Attributes:
        folder: With `agent.py`, `agent.json` and the agent's own files.
        track: SENSORS, or PRIVILEGED for an agent that is told what only the simulator knows.
        truths: What that is: components of the prompt.
    """

    folder: Path
    track: Track
    truths: tuple[str, ...]


def export_to_carla(spec: str, folder: Path) -> Exported:
    """Writes the folder, new.

    Args:
        spec: Of the agent, as `agents.load_agent` takes it.
        folder: To be made; there must be none.

    Raises:
        AgentSpecError: If there is no such agent, or it needs what CARLA has not.
        FileExistsError: If there is such a folder.
        OSError: If it cannot be written.
    """
    if folder.exists():
        raise FileExistsError(f"{folder} is there already: name another --output")
    agent = load_agent(spec)
    try:
        requires, told = agent.requires, told_by(agent)
        sensors, ticks = sensors_of(spec, requires), ticks_a_decision(spec, requires)
    finally:
        agent.close()
    truths = tuple(name for name in told if name in TRUTHS)
    track = Track.PRIVILEGED if truths else Track.SENSORS
    with whole_folder(folder) as made:
        settings = {
            "format": FORMAT,
            "agent": _carried(spec, made),
            "track": track.name,
            "told": bool(truths),
            "ticks_a_decision": ticks,
            "sensors": sensors,
            "python": sys.executable,
            "packages": str(Path(agents.__file__).parents[1]),
        }
        shutil.copyfile(SOURCE, made / AGENT_FILE)
        _write(made / SETTINGS_FILE, settings)
    return Exported(folder=folder, track=track, truths=truths)


def _write(path: Path, settings: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(settings, indent=1) + "\n", encoding="utf-8")


def _carried(spec: str, folder: Path) -> str:
    """An agent's specification in a folder to which its files are copied."""
    if named(spec)[0] in AGENTS:
        return spec
    scheme, _, place = spec.partition(":")
    if scheme in SCHEMES:
        path, options = place_and_options(spec, place)
        if options and any(Path(value).exists() for value in options.values()):
            raise AgentSpecError(f"agent '{spec}' names files behind its '?': they stay behind.")
        said = "&".join(f"{name}={value}" for name, value in options.items())
        return f"{scheme}:{_copied(Path(path), folder)}" + (f"?{said}" if said else "")
    file, _, class_name = spec.rpartition(":")
    if not file.endswith(".py"):
        raise AgentSpecError(f"agent '{spec}': name the file, path/to/file.py:Class, not a module.")
    return f"{_copied(Path(file), folder)}:{class_name}"


def _copied(path: Path, folder: Path) -> str:
    """The name in a folder of a copy of a file or of a folder."""
    name = CARRIED + path.suffix if path.is_file() else CARRIED
    if path.is_dir():
        shutil.copytree(path, folder / name)
    else:
        shutil.copyfile(path, folder / name)
    return name
