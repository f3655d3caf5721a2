"""A policy on disk: `config.json`, `weights.safetensors`, and the model card `README.md`.

Weights are loaded strictly, and only into the configuration that they were saved with. On disk they
are float16, half the size: a policy drives with weights that were rounded to it.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import safetensors.torch
import torch
from safetensors import SafetensorError
from torch import Tensor

from agents.driveinsight.config import FORMAT_VERSION, PolicyConfig
from agents.driveinsight.model import Policy
from di_envs.files.json_values import JsonError, indented, read_json
from di_envs.files.whole import write_whole

CONFIG_FILE = "config.json"
WEIGHTS_FILE = "weights.safetensors"
CARD_FILE = "README.md"


class WeightsError(ValueError):
    """A folder that holds no usable policy; the message says what to do."""


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
    write_whole(folder / CONFIG_FILE, indented(content))
    write_whole(folder / CARD_FILE, card)
    weights = {name: _halved(name, value) for name, value in policy.state_dict().items()}
    write_whole(folder / WEIGHTS_FILE, safetensors.torch.save(weights))


def _halved(name: str, value: Tensor) -> Tensor:
    """A tensor as it lies on disk: float16 for real numbers, on the CPU, contiguous."""
    value = value.detach().cpu()
    if not value.is_floating_point():
        return value.contiguous()
    halved = value.half()
    if not torch.isfinite(halved).all():
        raise WeightsError(
            f"'{name}' holds numbers that float16 cannot ({float(value.abs().max()):g} at most, or "
            f"NaN): train it again, with a lower learning rate"
        )
    return halved.contiguous()


def from_pretrained(folder: Path) -> Policy:
    """The policy of a folder, on the CPU, ready to drive.

    Raises:
        WeightsError: If a file is missing or broken, or of another format or configuration.
    """
    config = read_config(folder)
    path = folder / WEIGHTS_FILE
    if not path.is_file():
        raise WeightsError(f"there is no {path}: give a folder that save_pretrained wrote")
    try:
        weights = safetensors.torch.load_file(path)
    except (SafetensorError, OSError) as error:
        raise WeightsError(f"{path} is not whole ({error}): fetch or train it again") from error
    policy = Policy(config)
    try:
        policy.load_state_dict(weights, strict=True)
    except RuntimeError as error:
        first = " ".join(str(error).split("\n")[1:2]).strip()
        raise WeightsError(
            f"{path} does not fit {folder / CONFIG_FILE} ('{config.name}'): {first} Both must come "
            f"from one save_pretrained."
        ) from error
    if not all(torch.isfinite(value).all() for value in policy.state_dict().values()):
        raise WeightsError(f"{path} holds NaN or infinite weights: train it again")
    return policy.eval()


def read_config(folder: Path) -> PolicyConfig:
    """The configuration of a folder.

    Raises:
        WeightsError: If it is missing or broken, or of another format.
    """
    path = folder / CONFIG_FILE
    try:
        content = read_json(path)
    except JsonError as error:
        raise WeightsError(f"{error}: give a folder that save_pretrained wrote") from error
    version = content.pop("format_version", None) if isinstance(content, dict) else None
    if version != FORMAT_VERSION:
        raise WeightsError(
            f"{path} is of format {version}, this program reads {FORMAT_VERSION}: train again, or "
            f"install the release that wrote it"
        )
    try:
        return PolicyConfig.from_mapping(content, str(path))
    except JsonError as error:
        raise WeightsError(f"{error}: give a folder that save_pretrained wrote") from error


def weights_digest(folder: Path) -> str:
    """A hash of the weights in a folder.

    Raises:
        WeightsError: If there are none.
    """
    path = folder / WEIGHTS_FILE
    if not path.is_file():
        raise WeightsError(f"there is no {path}: give a folder that save_pretrained wrote")
    return hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()


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
    ours = policy.state_dict()
    fits = [n for n, value in theirs.items() if n in ours and ours[n].shape == value.shape]
    if not fits:
        raise WeightsError(f"nothing in {folder} has a name and shape that this policy has too")
    with torch.no_grad():
        for name in fits:
            ours[name].copy_(theirs[name])
    return fits, [name for name in theirs if name not in fits]
