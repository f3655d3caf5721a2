"""Systems on disk; see `agents.networks.weights` for the files and what they promise."""

from __future__ import annotations

from pathlib import Path

from agents.driveinsight.model import Policy
from agents.driveinsight.weights import from_pretrained as load_policy
from agents.networks.weights import (
    CONFIG_FILE,
    WeightsError,
    load_strictly,
    read_content,
    save_network,
)
from agents.zoo.registry import config_from, network_of
from agents.zoo.system import System, SystemModel
from di_envs.files.json_text import JsonError, read_json


def save_system(network: SystemModel, folder: Path, card: str) -> None:
    """Writes a system with its card; the folder is made.

    Raises:
        WeightsError: If a weight is no number that float16 holds.
    """
    content = {"format_version": System.FORMAT_VERSION, **network.config.to_mapping()}
    save_network(network, content, folder, card)


def load_system(folder: Path) -> SystemModel:
    """The system of a folder, on the CPU, ready to drive.

    Raises:
        WeightsError: If a file is missing or broken, or of another format or configuration.
    """
    content = read_content(folder, System.FORMAT_VERSION)
    try:
        config = config_from(content, str(folder / CONFIG_FILE))
    except JsonError as error:
        raise WeightsError(f"{error}: give a folder that a training of a system wrote") from error
    network = network_of(config)
    load_strictly(network, folder, config.name)
    return network.eval()


def load_network(folder: Path) -> Policy | SystemModel:
    """The network of a folder, whichever kind it is, on the CPU, ready to drive.

    Raises:
        WeightsError: As the two it chooses from.
    """
    return load_system(folder) if holds_system(folder) else load_policy(folder)


def holds_system(folder: Path) -> bool:
    """Whether a folder holds a system of the zoo, whole or not."""
    try:
        return bool("system" in read_json(folder / CONFIG_FILE))
    except JsonError:
        return False
