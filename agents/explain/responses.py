"""What a decision responds to: gradients of the waypoints and attention, for each component.

G_c of a component is the length (L2) of the gradient of p^c with respect to all its tokens, where
p^c is the mean of the predicted waypoints' coordinate c, x ahead or y right. It is how many metres
the mean waypoint moves for a small step of unit length in the component's tokens, taken in the
direction that moves it most. The paper defines neither p over several waypoints nor the norm; both
are chosen here, and scale all components alike.

Source: Li et al., Exploring the Causality of End-to-End Autonomous Driving, 2024, section 4.2.3.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from agents.base import Agent, Observation
from agents.explain.differentiate import Differentiated, differentiate, differentiate_agent
from agents.explain.protocol import Anatomy, Explainable, Span, TokenGroup


@dataclass(frozen=True, kw_only=True)
class Response:
    """What one decision responds to, over G components.

    Attributes:
        groups: Names of the components: those that the policy is ever given, so ten of the policy
            `small` (the prompt's nine and `bev`), nine of one without sensors.
        gradient: (G, 2) Gx and Gy, 0 or more [m per unit of token].
        attention: (layers, heads, G) share of a head's attention that a component's tokens get,
            together. It sums to 1 over the components, less what goes to tokens that no group has.
            (0, 0, G) for a policy without attention.
        waypoints: (T, 2) x ahead, y right of the ego [m].
    """

    groups: tuple[str, ...]
    gradient: NDArray[np.float32]
    attention: NDArray[np.float32]
    waypoints: NDArray[np.float32]


def responses_at(agent: Agent[Any], observation: Observation, memory: Any) -> Response:
    """What a decision responds to; arguments and errors are those of `differentiate_agent`."""
    return response_of(*differentiate_agent(agent, observation, memory, group_taps))


def token_gradients(
    policy: Explainable, observation: Observation, memory: Any
) -> Mapping[str, NDArray[np.float32]]:
    """The gradients behind a response, token by token.

    Returns:
        Component to (2, N, width): of p^x and p^y with respect to each of its N tokens.
    """
    anatomy = policy.anatomy
    passed = differentiate(policy, observation, memory, taps=group_taps(anatomy))
    return {
        name: _tokens(passed.gradients[group.tap], group).numpy()
        for name, group in anatomy.groups.items()
    }


def group_taps(anatomy: Anatomy) -> tuple[str, ...]:
    """The taps that the components' tokens pass."""
    return tuple(group.tap for group in anatomy.groups.values())


def response_of(anatomy: Anatomy, passed: Differentiated) -> Response:
    """The response of a decision that was differentiated at `group_taps`, attention watched."""
    groups = anatomy.groups
    gradients = [_tokens(passed.gradients[group.tap], group) for group in groups.values()]
    shares = [_shares(passed.activations[tap], groups) for tap in anatomy.attention]
    attention = torch.stack(shares) if shares else torch.zeros(0, 0, len(groups))
    lengths = [gradient.flatten(1).norm(dim=1) for gradient in gradients]
    return Response(
        groups=tuple(groups),
        gradient=(torch.stack(lengths) if lengths else torch.zeros(0, 2)).numpy(),
        attention=attention.numpy(),
        waypoints=passed.waypoints.numpy(),
    )


def _tokens(gradient: Tensor, group: TokenGroup) -> Tensor:
    """(2, N, width) of a tap's (2, 1, ..., width)."""
    tokens = gradient.flatten(1, -2) if gradient.ndim > 3 else gradient
    return tokens[:, _span(group.rows)]


def _shares(weights: Tensor, groups: Mapping[str, TokenGroup]) -> Tensor:
    """(heads, G) of (1, heads, queries, keys): the mean over the queries."""
    heads = weights[0].mean(dim=1)  # (heads, keys)
    none = heads.new_zeros(len(heads))
    return torch.stack(
        [
            none if group.keys is None else heads[:, _span(group.keys)].sum(dim=1)
            for group in groups.values()
        ],
        dim=1,
    )


def _span(span: Span | None) -> slice:
    return slice(None) if span is None else slice(*span)
