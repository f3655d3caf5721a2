"""`zoo:FOLDER`: the driver of whichever system a folder holds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agents import AgentSpecError, load_agent
from agents.hub import HubError, local_folder
from agents.networks.weights import CONFIG_FILE, WeightsError, read_content
from agents.zoo.registry import config_from
from agents.zoo.system import System
from di_envs.files.json_text import JsonError


class FolderDriver:
    """Makes the driver of a folder's system, which is of that system's class."""

    def __new__(cls, weights: str | Path, **options: Any) -> Any:
        try:
            folder = local_folder(weights)
            content = read_content(folder, System.FORMAT_VERSION)
            name = config_from(content, str(folder / CONFIG_FILE)).system
        except (WeightsError, HubError, JsonError) as error:
            raise AgentSpecError(f"agent 'zoo:{weights}': {error}") from error
        return load_agent(name, weights=folder, **options)
