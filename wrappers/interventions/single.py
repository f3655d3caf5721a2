"""`InterventionWrapper`: an environment in which the agent sees something else."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
from gymnasium import spaces

from wrappers.interventions.context import EditContext, context_of
from wrappers.interventions.edit import ObservationEdit
from wrappers.interventions.editing import Memory, ObservationEditing
from wrappers.interventions.eyes import Eyes


class InterventionWrapper(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Edits what a `RouteEnv` shows its agent. The world, its reward and its pictures stay real.

    What edits remember is what `di_envs.save` keeps of this wrapper.

    Attributes:
        editing: The edits.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        edits: str | Sequence[ObservationEdit],
        *,
        sees: spaces.Dict | None = None,
    ) -> None:
        """Wraps an environment; put it inside of wrappers that change the observation's form.

        Args:
            env: A `RouteEnv`, wrapped or not.
            edits: Such as `drop:routing; set:speed=0@t>5`, or values.
            sees: What the agent sees at all, where the environment shows more; None for all.

        Raises:
            EditError: If an edit cannot be read, or is about what is not seen.
        """
        super().__init__(env)
        if sees is not None:
            self.observation_space = sees
        space: Any = self.observation_space
        self.editing = ObservationEditing(edits, space)
        self._control_dt_s: float = env.get_wrapper_attr("config").control_dt_s
        self._fresh = self._before = self._eyes = Eyes.of(space, self.editing)
        self._context: EditContext | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts an episode, with nothing to remember."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._eyes = self._fresh
        return self._shown(observation, info), info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Steps the environment."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._shown(observation, info), reward, terminated, truncated, info

    def observe(self) -> Any:
        """What is shown at present once more: after an edit of the world, for instance.

        Raises:
            RuntimeError: Before the first reset.
        """
        observation = self.env.get_wrapper_attr("observe")()
        if self._context is None:
            raise RuntimeError("nothing has been shown yet; call reset() first")
        shown, self._eyes = self._before.look(observation, self._context)
        return shown

    def save_state(self) -> tuple[EditContext | None, tuple[Memory, ...], tuple[Memory, ...]]:
        """The moment, and what the edits remembered before and after it."""
        return self._context, self._before.memory, self._eyes.memory

    def restore_state(
        self, value: tuple[EditContext | None, tuple[Memory, ...], tuple[Memory, ...]]
    ) -> None:
        """Puts back what `save_state` returned."""
        self._context, before, after = value
        self._before = dataclasses.replace(self._fresh, memory=before)
        self._eyes = dataclasses.replace(self._fresh, memory=after)

    def _shown(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> Mapping[str, Any]:
        self._context = context_of(info, self._control_dt_s)
        self._before = self._eyes
        shown, self._eyes = self._before.look(observation, self._context)
        return shown
