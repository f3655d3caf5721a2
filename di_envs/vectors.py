"""Observations as plain vectors in [-1, 1], for policies that know nothing of metres and tables.

A function of the space and the observation, used by the wrapper that trains such a policy and by
the agent that drives with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeGuard

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray


def as_vectors_space(space: spaces.Dict) -> spaces.Dict:
    """The space of `as_vectors`: tables of real numbers become one-dimensional and scaled.

    Images, numbers of choices and flags stay what they are.
    """
    return spaces.Dict({name: vector_space(part) for name, part in space.spaces.items()})


def vector_space(space: spaces.Space[Any]) -> spaces.Space[Any]:
    """A Box of real numbers as a vector in [-1, 1] (in [0, 1] where nothing is negative)."""
    if not _is_table(space):
        return space
    scale = scale_of(space)
    low, high = ((bound / scale).ravel().astype(np.float32) for bound in (space.low, space.high))
    return spaces.Box(low, high, dtype=np.float32)


def _is_table(space: spaces.Space[Any]) -> TypeGuard[spaces.Box]:
    """Whether a part of an observation is made of real numbers."""
    return isinstance(space, spaces.Box) and np.issubdtype(space.dtype, np.floating)


def scale_of(space: spaces.Box) -> NDArray[np.float64]:
    """What each number is divided by: the larger of its bounds, so that zero stays zero."""
    largest = np.maximum(np.abs(space.low), np.abs(space.high)).astype(np.float64)
    return np.where(largest > 0.0, largest, 1.0)


def as_vectors(observation: Mapping[str, Any], space: spaces.Dict) -> dict[str, Any]:
    """An observation of `space` as one of `as_vectors_space(space)`."""
    return {name: as_vector(observation[name], part) for name, part in space.spaces.items()}


def as_vector(value: Any, space: spaces.Space[Any]) -> Any:
    """One part of an observation: a table becomes a scaled vector, others are returned as is."""
    if not _is_table(space):
        return value
    return (np.asarray(value, np.float64) / scale_of(space)).ravel().astype(np.float32)
