"""Policies that were never trained and drive all the same, each its own way."""

from __future__ import annotations

from pathlib import Path

import torch

from agents.driveinsight.config import config_named
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import save_pretrained


def save_untrained(folder: Path, name: str, seed: int = 0) -> Path:
    """Writes an untrained policy of a configuration that plans to go ahead at some 5 m/s."""
    torch.manual_seed(seed)
    policy = Policy(config_named(name))
    with torch.no_grad():
        policy.planner.steps.bias[0::2] += 1.25  # of 2 m, each half second; else it would stand
    save_pretrained(policy, folder, "")
    return folder
