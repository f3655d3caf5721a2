"""The model card: what a policy is, what it was trained on and how, how it drove, what it lacks."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from torch import nn

from agents.driveinsight.config import PolicyConfig
from agents.training.config import TrainConfig

_LIMITS = """\
It has seen made-up towns of this simulator only, with its own pictures of them, driven by the
expert of this project; it knows no real road. Of its prompt the map, obstacles, lights and signs
are the simulator's truth, which no real car has. It is made for research on why such policies act
as they do, not for driving."""


def model_card(
    policy: nn.Module,
    config: TrainConfig,
    *,
    step: int,
    log: Sequence[Mapping[str, float]],
    checks: Sequence[Mapping[str, float]],
    about_data: Mapping[str, Any],
) -> str:
    """The card as Markdown.

    Args:
        policy: With its `config`.
        config: How it was trained.
        step: Steps done.
        log: Rows of the training's log.
        checks: Rows of its closed-loop checks.
        about_data: The data card; see `collect.data_card`.
    """
    shape: PolicyConfig = policy.config  # type: ignore[assignment]
    size = sum(parameter.numel() for parameter in policy.parameters())
    parts = [
        f"# DriveInsight policy `{shape.name}`",
        f"{size:,} parameters; reads {', '.join(shape.observations)}; prompt components "
        f"{', '.join(shape.prompt) or 'none'}; {shape.planner.waypoints} waypoints "
        f"{shape.planner.waypoint_dt_s} s apart.",
        "## Training",
        f"Step {step} of {config.steps}; batches of {config.batch}.",
        _json(config.to_mapping()),
        "Hidden in training, at these rates, fixed beforehand:",
        _json(dict(shape.planner.dropout)),
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
