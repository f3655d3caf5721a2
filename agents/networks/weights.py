"""A network on disk: `config.json`, `weights.safetensors`, and its card `README.md`.

Weights are loaded strictly, and only into the configuration that they were saved with. On disk they
are float16, half the size: a network drives with weights that were rounded to it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import safetensors.torch
import torch
from safetensors import SafetensorError
from torch import Tensor, nn

from agents.hub import with_metadata
from di_envs.files.json_text import JsonError, indented, read_json, shown
from di_envs.files.plain_text import one_plain_line
from di_envs.files.whole import write_whole

CONFIG_FILE = "config.json"
WEIGHTS_FILE = "weights.safetensors"
CARD_FILE = "README.md"


class WeightsError(ValueError):
    """A folder that holds no usable policy; the message says what to do."""


def save_network(network: nn.Module, content: Mapping[str, Any], folder: Path, card: str) -> None:
    """Writes a network, its configuration and its card; the folder is made.

    Args:
        network: On any device, in any mode.
        content: Of the configuration's file, with its `format_version`.
        folder: Where to.
        card: Markdown: data, configuration, scores, limits.

    Raises:
        WeightsError: If a weight is no number that float16 holds.
    """
    write_whole(folder / CONFIG_FILE, indented(content))
    write_whole(folder / CARD_FILE, with_metadata(card))
    weights = {name: _halved(name, value) for name, value in network.state_dict().items()}
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


def read_content(folder: Path, version: int) -> dict[str, Any]:
    """What a folder's configuration says, without its version.

    Raises:
        WeightsError: If it is missing or broken, or of another format.
    """
    path = folder / CONFIG_FILE
    try:
        content = read_json(path)
    except JsonError as error:
        raise WeightsError(f"{error}: give a folder that `driveinsight train` wrote") from error
    found = content.pop("format_version", None) if isinstance(content, dict) else None
    if found != version:
        raise WeightsError(
            f"{path} is of format {shown(found)}, this program reads {version}: train again, or "
            f"install the release that wrote it"
        )
    return dict(content)


def load_strictly(network: nn.Module, folder: Path, name: str) -> None:
    """Loads the weights of a folder into the network that they were saved from.

    Args:
        network: Of the folder's configuration.
        folder: Of the weights.
        name: Of that configuration, for the error.

    Raises:
        WeightsError: If they are missing or broken, or of another network.
    """
    path = folder / WEIGHTS_FILE
    if not path.is_file():
        raise WeightsError(f"there is no {path}: give a folder that `driveinsight train` wrote")
    try:
        weights = safetensors.torch.load_file(path)
    except (SafetensorError, OSError) as error:
        said = one_plain_line(str(error))
        raise WeightsError(f"{path} is not whole ({said}): fetch or train it again") from error
    try:
        network.load_state_dict(weights, strict=True)
    except RuntimeError as error:
        first = one_plain_line(" ".join(str(error).split("\n")[1:2]))
        raise WeightsError(
            f"{path} does not fit {folder / CONFIG_FILE} ({shown(name)}): {first} Both must come "
            f"from one save_pretrained."
        ) from error
    if not all(torch.isfinite(value).all() for value in network.state_dict().values()):
        raise WeightsError(f"{path} holds NaN or infinite weights: train it again")


def weights_digest(folder: Path) -> str:
    """A hash of the weights in a folder.

    Raises:
        WeightsError: If there are none.
    """
    path = folder / WEIGHTS_FILE
    if not path.is_file():
        raise WeightsError(f"there is no {path}: give a folder that `driveinsight train` wrote")
    return hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()


def take_tensors(
    network: nn.Module, theirs: Mapping[str, Tensor], folder: Path
) -> tuple[list[str], list[str]]:
    """Takes over the tensors of another network that have the same names and shapes.

    Args:
        network: That takes; the rest of it stays as it is.
        theirs: The other one's, by name.
        folder: Where they are from, for the error.

    Returns:
        Names of the tensors taken, and of those of the other network that find no place.

    Raises:
        WeightsError: If nothing of it fits.
    """
    ours = network.state_dict()
    fits = [n for n, value in theirs.items() if n in ours and ours[n].shape == value.shape]
    if not fits:
        raise WeightsError(f"nothing in {folder} has a name and shape that this policy has too")
    with torch.no_grad():
        for name in fits:
            ours[name].copy_(theirs[name])
    return fits, [name for name in theirs if name not in fits]
