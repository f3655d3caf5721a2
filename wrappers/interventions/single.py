"""`InterventionWrapper`: an environment in which the agent sees something else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium

from wrappers.interventions.context import EditContext, context_of
from wrappers.interventions.edit import ObservationEdit
from wrappers.interventions.editing import Memory, ObservationEditing


class InterventionWrapper(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Edits what a `RouteEnv` shows its agent. The world, its reward and its pictures stay real.

    What edits remember is what `di_envs.save` keeps of this wrapper.

    Attributes:
        editing: The edits.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], edits: str | Sequence[ObservationEdit]
    ) -> None:
        """Wraps an environment; put it inside of wrappers that change the observation's form.

        Args:
            env: A `RouteEnv`, wrapped or not.
            edits: Such as `drop:routing; set:speed=0@t>5`, or values.

        Raises:
            EditError: If an edit cannot be read, or is about what is not seen.
        """
        super().__init__(env)
        self.editing = ObservationEditing(edits, env.observation_space)
        self._control_dt_s: float = env.get_wrapper_attr("config").control_dt_s
        self._before = self._memory = self.editing.start()
        self._context: EditContext | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts an episode, with nothing to remember."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._memory = self.editing.start()
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
        shown, self._memory = self.editing.apply(observation, self._context, self._before)
        return shown

    def save_state(self) -> tuple[EditContext | None, Memory, Memory]:
        """The moment, and what the edits remembered before and after it."""
        return self._context, self._before, self._memory

    def restore_state(self, value: tuple[EditContext | None, Memory, Memory]) -> None:
        """Puts back what `save_state` returned."""
        self._context, self._before, self._memory = value

    def _shown(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> Mapping[str, Any]:
        self._context = context_of(info, self._control_dt_s)
        self._before = self._memory
        shown, self._memory = self.editing.apply(observation, self._context, self._before)
        return shown
