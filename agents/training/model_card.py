"""The model card: what a policy is, what it was trained on and how, how it drove, what it lacks."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from torch import nn

from agents.driveinsight.config import PolicyConfig
from agents.training.config import TrainConfig
from agents.zoo.registry import system_of
from agents.zoo.system import MOMENT_DT_S, SystemConfig

_LIMITS = """\
It has seen no town but those under Data, in this simulator's own pictures; it knows no real road.
What it is told of the map, obstacles, lights and signs is the simulator's truth, which no real car
has. It is made for research on why such policies act as they do, not for driving."""


def about_policy(network: nn.Module, config: PolicyConfig) -> tuple[str, ...]:
    """What a policy of the paper's kind is: the title, and a paragraph each."""
    return (
        f"# DriveInsight policy `{config.name}`",
        f"{_size(network):,} parameters; reads {', '.join(config.observations)}; prompt components "
        f"{', '.join(config.prompt) or 'none'}; {config.planner.waypoints} waypoints "
        f"{config.planner.waypoint_dt_s} s apart.",
        "Hidden in training, at these rates, alone and together:",
        _json({**config.planner.dropout, **config.planner.together}),
    )


def about_system(network: nn.Module, config: SystemConfig) -> tuple[str, ...]:
    """What a system of the zoo is: the title, and a paragraph each."""
    eyes = system_of(config.system).eyes
    begun = f" Its cameras' encoders are those of `{eyes}`, and learnt no more." if eyes else ""
    return (
        f"# System `{config.name}`",
        f"{_size(network):,} parameters; sees {config.inputs}; {config.waypoints} waypoints "
        f"{MOMENT_DT_S} s apart.{begun}",
        _json(config.to_mapping()),
    )


def _size(network: nn.Module) -> int:
    return sum(parameter.numel() for parameter in network.parameters())


def model_card(
    about: Sequence[str],
    config: TrainConfig,
    *,
    step: int,
    log: Sequence[Mapping[str, float]],
    checks: Sequence[Mapping[str, float]],
    about_data: Mapping[str, Any],
) -> str:
    """The card as Markdown.

    Args:
        about: What it is: the title, and a paragraph each.
        config: How it was trained.
        step: Steps done.
        log: Rows of the training's log.
        checks: Rows of its closed-loop checks.
        about_data: The data card; see `data_card.data_card`.
    """
    parts = [
        *about,
        "## Training",
        f"Step {step} of {config.steps}; batches of {config.batch}.",
        _json(config.to_mapping()),
    ]
    if log:
        terms = ", ".join(f"{name} {value:.3f}" for name, value in log[-1].items())
        parts.append(f"Last row of the log: {terms}.")
    parts += ["## Data", _json(about_data) if about_data else "Not told."]
    parts += ["## How it drove while it was trained", _table(checks) or "It was not checked."]
    return "\n\n".join([*parts, "## Limits", _LIMITS]) + "\n"


def _json(values: Mapping[str, Any]) -> str:
    return f"```json\n{json.dumps(values, indent=1)}\n```"


def _table(rows: Sequence[Mapping[str, float]]) -> str:
    if not rows:
        return ""
    lines = [" | ".join(rows[0]), " | ".join("---" for _ in rows[0])]
    lines += [" | ".join(f"{value:g}" for value in row.values()) for row in rows]
    return "\n".join(f"| {line} |" for line in lines)
