"""A policy on disk; see `agents.networks.weights` for the files and what they promise."""

from __future__ import annotations

from pathlib import Path

from agents.driveinsight.config import FORMAT_VERSION, PolicyConfig
from agents.driveinsight.model import Policy
from agents.networks.weights import (
    CONFIG_FILE,
    WeightsError,
    load_strictly,
    read_content,
    save_network,
    take_tensors,
    weights_digest,
)
from di_envs.files.json_text import JsonError


def save_pretrained(policy: Policy, folder: Path, card: str) -> None:
    """Writes a policy and its card; the folder is made.

    Args:
        policy: On any device, in any mode.
        folder: Where to.
        card: Markdown: data, configuration, scores, limits.

    Raises:
        WeightsError: If a weight is no number that float16 holds.
    """
    content = {"format_version": FORMAT_VERSION, **policy.config.to_mapping()}
    save_network(policy, content, folder, card)


def from_pretrained(folder: Path) -> Policy:
    """The policy of a folder, on the CPU, ready to drive.

    Raises:
        WeightsError: If a file is missing or broken, or of another format or configuration.
    """
    config = read_config(folder)
    policy = Policy(config)
    load_strictly(policy, folder, config.name)
    return policy.eval()


def read_config(folder: Path) -> PolicyConfig:
    """The configuration of a folder.

    Raises:
        WeightsError: If it is missing or broken, or of another format.
    """
    content = read_content(folder, FORMAT_VERSION)
    try:
        return PolicyConfig.from_mapping(content, str(folder / CONFIG_FILE))
    except JsonError as error:
        raise WeightsError(f"{error}: give a folder that `driveinsight train` wrote") from error


def take_weights(policy: Policy, folder: Path, *, only: str = "") -> tuple[list[str], list[str]]:
    """Takes over the tensors of another policy that have the same names and shapes.

    The other one may be smaller: a policy that reads the prompt alone can teach its planner and its
    encoders to one with cameras.

    Args:
        policy: That takes; the rest of it stays as it is.
        folder: Of the other one.
        only: What the names of these tensors begin with; empty for all.

    Returns:
        Names of the tensors taken, and of those of the other policy that find no place.

    Raises:
        WeightsError: If the folder holds no usable policy, or nothing in it fits.
    """
    state = from_pretrained(folder).state_dict()
    theirs = {name: value for name, value in state.items() if name.startswith(only)}
    return take_tensors(policy, theirs, folder)


__all__ = [
    "WeightsError",
    "from_pretrained",
    "read_config",
    "save_pretrained",
    "take_weights",
    "weights_digest",
]
