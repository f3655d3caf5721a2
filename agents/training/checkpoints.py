"""What every training shares: a checkpoint that is whole or not there, and how the rate falls."""

from __future__ import annotations

import math
import pickle
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import nn

from agents.training.config import TrainingError
from di_envs.differences import differences
from di_envs.files.received import check_ordinary
from di_envs.files.whole import write_whole

_NOT_WHOLE = (
    *(OSError, RuntimeError, EOFError, KeyError, ValueError, TypeError, IndexError),
    *(AttributeError, pickle.UnpicklingError, zipfile.BadZipFile),
)


def save_checkpoint(
    path: Path,
    asked: Mapping[str, Any],
    policy: nn.Module,
    optimiser: torch.optim.Optimizer,
    step: int,
) -> None:
    """Writes a checkpoint; the old one stays until the new one is whole.

    Args:
        path: Where.
        asked: All that decides what comes out, as plain values.
        policy: Whose weights are kept.
        optimiser: Whose moments are kept.
        step: Updates so far.
    """
    content = {
        "asked": dict(asked),
        "policy": policy.state_dict(),
        "optimiser": optimiser.state_dict(),
        "step": step,
    }
    write_whole(path, lambda file: torch.save(content, file))


def load_checkpoint(
    path: Path,
    asked: Mapping[str, Any],
    policy: nn.Module,
    optimiser: torch.optim.Optimizer,
    *,
    defaults: Mapping[str, Any],
) -> int:
    """Takes over weights and moments; returns how many updates there have been.

    Args:
        path: Of the checkpoint.
        asked: As for `save_checkpoint`: what is asked for now.
        policy: Takes the weights.
        optimiser: Takes the moments.
        defaults: Of what may be newer than the checkpoint: it was made with these.

    Raises:
        TrainingError: If it is not whole, or of another policy or training.
    """
    device = next(policy.parameters()).device
    try:
        check_ordinary(path)
        content = torch.load(path, weights_only=True, map_location=device)
        was = {**defaults, **content["asked"]}
    except _NOT_WHOLE as error:
        raise _not_whole(path, error) from error
    if different := differences(was, dict(asked)):
        said = "; ".join(difference.was_is for difference in different)
        raise TrainingError(
            f"{path} is of another training ({said}): give the same options to go on with it, or "
            f"another --output to begin a new one"
        )
    try:
        policy.load_state_dict(content["policy"])
        optimiser.load_state_dict(content["optimiser"])
        return int(content["step"])
    except _NOT_WHOLE as error:
        raise _not_whole(path, error) from error


def rate_at(step: int, *, highest: float, warm_up: int, steps: int) -> float:
    """The learning rate: it rises evenly over `warm_up` steps, then falls to 0 along a cosine."""
    if step < warm_up:
        return highest * (step + 1) / warm_up
    done = (step - warm_up) / max(steps - warm_up, 1)
    return highest * 0.5 * (1.0 + math.cos(math.pi * min(done, 1.0)))


def _not_whole(path: Path, error: Exception) -> TrainingError:
    return TrainingError(f"{path} is not whole ({error!r}): delete it to begin again")
