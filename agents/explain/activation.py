"""Activation maps: which places of a map of features the predicted waypoints rest on.

With A^k channel k of the features, Z its number of cells and p^c the waypoints' coordinate c,

    alpha_k^c = 1/Z sum_ij dp^c / dA_ij^k        for c = x (ahead) and y (right)
    F = sqrt( (sum_k alpha_k^x A^k)^2 + (sum_k alpha_k^y A^k)^2 )

Source: the paper, section 4.2.4, after Selvaraju et al., Grad-CAM, ICCV 2017. There p is "the
predicted waypoints"; here it is their mean, as in `responses`, which scales a map as a whole.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from agents.base import Agent, Observation
from agents.explain.differentiate import Differentiated, differentiate
from agents.explain.protocol import Anatomy, explainable


def activation_maps(
    agent: Agent[Any], observation: Observation, memory: Any
) -> Mapping[str, NDArray[np.float32]]:
    """The activation maps of a decision.

    Args:
        agent: With a method `explainable()`, see `protocol`.
        observation: As `act` was given it.
        memory: As `act` was given it; neither is changed.

    Returns:
        Name to a map of numbers 0 or more. `bev`: (X, Y) in the ego's grid, rows ahead, columns
        right. One for each camera, `camera_front` and so on: (h, w), rows down, columns right, over
        the whole picture. `explainable(agent).anatomy.maps` has their extents. Without sensors it
        is empty.

    Raises:
        NotExplainableError: If its policy cannot be looked into.
    """
    policy = explainable(agent)
    passed = differentiate(policy, observation, memory, taps=map_taps(policy.anatomy))
    return maps_of(policy.anatomy, passed)


def map_taps(anatomy: Anatomy) -> tuple[str, ...]:
    """The taps that the maps of features pass."""
    return tuple(part.tap for part in anatomy.maps.values())


def maps_of(anatomy: Anatomy, passed: Differentiated) -> dict[str, NDArray[np.float32]]:
    """The maps of a decision that was differentiated at `map_taps`."""
    return {
        name: activation_map(
            passed.activations[part.tap][part.item], passed.gradients[part.tap][:, part.item]
        ).numpy()
        for name, part in anatomy.maps.items()
    }


def activation_map(features: Tensor, gradients: Tensor) -> Tensor:
    """The paper's two formulas.

    Args:
        features: (C, rows, columns).
        gradients: (2, C, rows, columns) of p^x and p^y with respect to them.

    Returns:
        (rows, columns).
    """
    alpha = gradients.mean(dim=(2, 3))  # (2, C)
    weighted = (alpha[:, :, None, None] * features).sum(dim=1)  # (2, rows, columns)
    return weighted.norm(dim=0)
