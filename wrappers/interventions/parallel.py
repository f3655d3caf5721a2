"""`ParallelInterventions`: edits of what the egos of one world see, each ego's its own."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

from pettingzoo.utils.wrappers import BaseParallelWrapper

from di_envs.config import check_name
from di_envs.edits.text import EditError
from di_envs.multi_ego import MultiEgoEnv, MultiEgoSnapshot
from wrappers.interventions.context import context_of
from wrappers.interventions.edit import ObservationEdit
from wrappers.interventions.editing import Memory, ObservationEditing

Edits = str | Sequence[ObservationEdit]


class ParallelInterventions(BaseParallelWrapper[str, dict[str, Any], Any]):
    """Edits what a `MultiEgoEnv` shows its egos.

    Attributes:
        editing: By ego, its edits.
    """

    def __init__(self, env: MultiEgoEnv, edits: Edits | Mapping[str, Edits]) -> None:
        """Wraps a `MultiEgoEnv`.

        Args:
            env: The world.
            edits: For all egos, or a mapping from an ego's name to those for it alone.

        Raises:
            EditError: If an edit cannot be read, is about what is not seen, or for nobody.
        """
        super().__init__(env)
        each = edits if isinstance(edits, Mapping) else dict.fromkeys(env.possible_agents, edits)
        for name in each:
            try:
                check_name(name, env.possible_agents, "agent")
            except ValueError as error:
                raise EditError(str(error)) from error
        self.editing = {
            name: ObservationEditing(own, env.observation_space(name)) for name, own in each.items()
        }
        self._egos = {name: ego for ego, name in enumerate(env.possible_agents)}
        self._control_dt_s = env.config.control_dt_s
        self._memory: dict[str, Memory] = {}

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Starts an episode, with nothing to remember."""
        observations, infos = self.env.reset(seed=seed, options=options)
        self._memory = {name: editing.start() for name, editing in self.editing.items()}
        return self._shown(observations, infos), infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Holds each ego's action."""
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        return self._shown(observations, infos), rewards, terminated, truncated, infos

    def save_state(self) -> tuple[MultiEgoSnapshot, dict[str, Memory]]:
        """The world, and what the edits remember."""
        world: Any = self.env
        return world.save_state(), copy.copy(self._memory)

    def restore_state(self, value: tuple[MultiEgoSnapshot, dict[str, Memory]]) -> None:
        """Puts back what `save_state` returned."""
        world: Any = self.env
        snapshot, memory = value
        world.restore_state(snapshot)
        self._memory = copy.copy(memory)

    def _shown(self, observations: Mapping[str, Any], infos: Mapping[str, Any]) -> dict[str, Any]:
        shown = dict(observations)
        for name in (name for name in self.editing if name in shown):
            context = context_of(infos[name], self._control_dt_s, self._egos[name])
            shown[name], self._memory[name] = self.editing[name].apply(
                shown[name], context, self._memory[name]
            )
        return shown
