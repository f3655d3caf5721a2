"""`VectorObservations`: every table of the observation as a vector in [-1, 1]."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
from gymnasium import spaces

from di_envs.vectors import as_vectors, as_vectors_space


class VectorObservations(gymnasium.ObservationWrapper[dict[str, Any], Any, Mapping[str, Any]]):
    """Divides each number by the largest that it can be, and lays tables out in one row.

    What Stable-Baselines3's own `MultiInputPolicy` asks for: it reads 3-dimensional tables as
    images, and metres beside fractions teach it little. Images, commands and flags are left as they
    are. Put it outside of wrappers that edit the observation.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        if not isinstance(env.observation_space, spaces.Dict):
            raise ValueError(f"Expected a Dict of observations; got {env.observation_space}.")
        self._tables = env.observation_space
        self.observation_space = as_vectors_space(env.observation_space)

    def observation(self, observation: Mapping[str, Any]) -> dict[str, Any]:
        """The observation as vectors."""
        return as_vectors(observation, self._tables)
