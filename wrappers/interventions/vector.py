"""`VectorInterventions`: the same edits in all worlds of a vector environment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv, VectorWrapper
from numpy.typing import NDArray

from wrappers.interventions.context import context_of
from wrappers.interventions.edit import ObservationEdit
from wrappers.interventions.editing import Memory, ObservationEditing

_KNOWN = ("world_seed", "game_time_s", "route_completion", "junction_m")


class VectorInterventions(VectorWrapper):
    """Edits what a `RouteVectorEnv` shows; each world gets the bits that it gets alone.

    Attributes:
        editing: The edits.
    """

    def __init__(
        self, env: VectorEnv[Any, Any, Any], edits: str | Sequence[ObservationEdit]
    ) -> None:
        """Wraps a `RouteVectorEnv`.

        Args:
            env: The worlds.
            edits: Such as `drop:routing; set:speed=0@t>5`, or values.

        Raises:
            EditError: If an edit cannot be read, or is about what is not seen.
        """
        super().__init__(env)
        self.editing = ObservationEditing(edits, env.single_observation_space)
        worlds: Any = env.unwrapped
        self._control_dt_s: float = worlds.envs[0].config.control_dt_s
        self._memory = self.editing.start()
        self._told: dict[str, NDArray[Any]] = {}

    def reset(
        self,
        *,
        seed: Any = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Starts an episode in every world, or in those of a mask."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._shown(observation, info), info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Steps every world."""
        observation, rewards, terminated, truncated, info = self.env.step(actions)
        if "final_obs" in info:
            info = {**info, "final_obs": self._finals(info)}
        return self._shown(observation, info), rewards, terminated, truncated, info

    def save_state(self) -> tuple[dict[str, NDArray[Any]], Memory]:
        """The moments of the worlds, and what the edits remember."""
        return {name: told.copy() for name, told in self._told.items()}, self._memory

    def restore_state(self, value: tuple[dict[str, NDArray[Any]], Memory]) -> None:
        """Puts back what `save_state` returned."""
        told, self._memory = value
        self._told = {name: array.copy() for name, array in told.items()}

    def _shown(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> Mapping[str, Any]:
        for name in _KNOWN:
            new, who = np.asarray(info[name]), np.asarray(info[f"_{name}"], bool)
            old = self._told.get(name)
            # Worlds that a mask leaves alone are where they were
            self._told[name] = new if old is None else np.where(who, new, old)
        context = context_of(self._told, self._control_dt_s)
        shown, self._memory = self.editing.apply(observation, context, self._memory)
        return shown

    def _finals(self, info: Mapping[str, Any]) -> NDArray[Any]:
        """What worlds were last shown whose step has begun the next episode already."""
        finals = np.array(info["final_obs"], dtype=object)
        told = info["final_info"]
        for index in np.flatnonzero(info["_final_obs"]).tolist():
            moment = {name: np.asarray(told[name])[index] for name in _KNOWN}
            context = context_of(moment, self._control_dt_s)
            finals[index], _ = self.editing.apply(finals[index], context, _row(self._memory, index))
        return finals


def _row(memory: Memory, index: int) -> Memory:
    """One world's memory: of arrays with a leading axis of worlds, that world's."""
    return tuple(_row_of(value, index) for value in memory)


def _row_of(value: Any, index: int) -> Any:
    if isinstance(value, np.ndarray):
        return value[index]
    if isinstance(value, Mapping):
        return {name: _row_of(part, index) for name, part in value.items()}
    if isinstance(value, tuple | list):
        return type(value)(_row_of(part, index) for part in value)
    return value
