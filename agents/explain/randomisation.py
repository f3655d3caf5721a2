"""Whether explanations depend on what was learnt: they must change when the weights are shuffled.

A map that looks the same for a network with shuffled weights shows the picture's edges, not what
the network learnt. Weights are shuffled part by part, from the output back to the input; after each
part the maps and gradients are compared with those of the trained weights, by rank.

Source: Adebayo et al., Sanity Checks for Saliency Maps, NeurIPS 2018 (cascading randomisation).
What we changed: the values of each tensor are shuffled, not drawn anew, so that their sizes stay.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import nn

from agents.base import Agent, Observation
from agents.explain.look import DecisionLook, look_at
from agents.explain.protocol import explainable
from di_envs.config import check_name


@dataclass(frozen=True, kw_only=True)
class Randomised:
    """What is left of an explanation once some weights are shuffled.

    Attributes:
        parts: Whose weights are, all up to this one.
        maps: Activation map to its rank correlation with the one of the trained weights.
        gradient: The same of the components' gradients.
        waypoints_m: How far the mean waypoint has moved [m].
    """

    parts: tuple[str, ...]
    maps: Mapping[str, float]
    gradient: float
    waypoints_m: float


def randomisation_check(
    agent: Agent[Any],
    observation: Observation,
    memory: Any,
    *,
    parts: Sequence[str] = (),
    seed: int = 0,
) -> tuple[Randomised, ...]:
    """Shuffles the weights of a policy, part by part, and looks at one decision each time.

    Args:
        agent: With a method `explainable()`; its weights are put back.
        observation: As `act` was given it.
        memory: As `act` was given it.
        parts: Dotted paths of submodules, the first to be shuffled first; without any, the model's
            children that have weights, from the last to the first.
        seed: Of the shuffling.

    Raises:
        NotExplainableError: If the policy cannot be looked into.
        ValueError: If there is no such part.
    """
    model = explainable(agent).model
    parts = tuple(parts) or _children(model)
    before = look_at(agent, observation, memory)
    found = []
    for count in range(1, len(parts) + 1):
        with shuffled(model, parts[:count], seed):
            found.append(_compared(parts[:count], before, look_at(agent, observation, memory)))
    return tuple(found)


@contextmanager
def shuffled(model: nn.Module, parts: Sequence[str], seed: int) -> Iterator[None]:
    """The model with the values of each parameter of some parts shuffled; then as it was.

    Raises:
        ValueError: If there is no such part.
    """
    modules = dict(model.named_modules())
    for part in parts:
        check_name(part, [name for name in modules if name], "part of the model")
    chosen = {id(p): p for part in parts for p in modules[part].parameters()}
    kept = [(parameter, parameter.detach().clone()) for parameter in chosen.values()]
    draw = torch.Generator().manual_seed(seed)
    try:
        with torch.no_grad():
            for parameter, values in kept:
                order = torch.randperm(values.numel(), generator=draw).to(values.device)
                parameter.copy_(values.reshape(-1)[order].view_as(values))
        yield
    finally:
        with torch.no_grad():
            for parameter, values in kept:
                parameter.copy_(values)


def rank_correlation(one: ArrayLike, other: ArrayLike) -> float:
    """Spearman's, over all entries; 0 where either is the same everywhere."""
    ranks = [_ranks(np.asarray(values).reshape(-1)) for values in (one, other)]
    centred = [rank - rank.mean() for rank in ranks]
    length = np.linalg.norm(centred[0]) * np.linalg.norm(centred[1])
    return float(centred[0] @ centred[1] / length) if length > 0.0 else 0.0


def _ranks(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Equal values share their mean rank."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    ranks: np.ndarray[Any, Any] = (last - (counts - 1) / 2.0)[inverse]
    return ranks


def _compared(parts: tuple[str, ...], before: DecisionLook, after: DecisionLook) -> Randomised:
    moved = after.response.waypoints.mean(axis=0) - before.response.waypoints.mean(axis=0)
    return Randomised(
        parts=parts,
        maps={name: rank_correlation(part, after.maps[name]) for name, part in before.maps.items()},
        gradient=rank_correlation(before.response.gradient, after.response.gradient),
        waypoints_m=float(np.hypot(*moved)),
    )


def _children(model: nn.Module) -> tuple[str, ...]:
    names = [
        name for name, child in model.named_children() if any(True for _ in child.parameters())
    ]
    return tuple(reversed(names))
