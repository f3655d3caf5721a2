"""The core: what an agent sees, edited. A function of values, for one world or for many at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from di_envs.edits.conditions import UNITS
from di_envs.edits.text import EditError
from wrappers.interventions.context import EditContext
from wrappers.interventions.edit import Observation, ObservationEdit
from wrappers.interventions.layout import beside, names_in
from wrappers.interventions.table import read_observation_edits

Memory = tuple[Any, ...]  # one value an edit; None where there is nothing to remember


@dataclass(frozen=True, kw_only=True)
class _Step:
    """An edit, and the entries of this observation that it is about."""

    edit: ObservationEdit
    names: tuple[str, ...]


class ObservationEditing:
    """Edits for observations of one space. It has no memory: that is a value, passed in and out.

    Attributes:
        edits: In the order in which they are made, each seeing what those before it show.
    """

    def __init__(self, edits: str | Sequence[ObservationEdit], space: spaces.Space[Any]) -> None:
        """Checks the edits against what there is to see.

        Args:
            edits: Values, or their text.
            space: Of one world's observations.

        Raises:
            EditError: If a text cannot be read, or an edit is about what the agent does not see or
                what it cannot edit.
        """
        if not isinstance(space, spaces.Dict):
            raise EditError(f"edits are of named entries: expected a Dict of them, got {space}")
        if isinstance(space.get("command"), spaces.Box):
            raise EditError(
                "edits are of observations as they are, and with preset='box' a command is no "
                "choice any more: make the environment without a preset"
            )
        self.edits = read_observation_edits(edits) if isinstance(edits, str) else tuple(edits)
        self._space = space
        self._steps = tuple(_Step(edit=edit, names=self._names(edit)) for edit in self.edits)

    @property
    def texts(self) -> tuple[str, ...]:
        """As they are written."""
        return tuple(map(str, self.edits))

    def start(self) -> Memory:
        """The memory before anything is seen."""
        return (None,) * len(self._steps)

    def apply(
        self, observation: Observation, context: EditContext, memory: Memory
    ) -> tuple[Mapping[str, Any], Memory]:
        """What the agent is shown.

        Args:
            observation: What there is to see: of one world, or (..., *shape) of many. It and its
                arrays are left as they are.
            context: The moment, of as many worlds.
            memory: What this returned at the moment before, or `start()`.

        Returns:
            The observation, which stays in its space and shares the arrays that no edit is about,
            and the memory for the next moment.
        """
        shown, kept = observation, []
        for step, old in zip(self._steps, memory, strict=True):
            holds: Any = step.edit.when.holds(context.values()) if step.edit.when.terms else True
            # numpy's any and all take longer than a small edit, where one world says yes or no
            one = isinstance(holds, bool | np.bool_)
            somewhere = bool(holds) if one else bool(holds.any())
            if not step.edit.remembers and not somewhere:
                kept.append(old)
                continue
            changes, new = step.edit.changes(step.names, shown, context, old)
            kept.append(new)
            if somewhere:
                worlds = None if one or holds.all() else holds
                shown = {**shown, **self._allowed(step.edit, changes, shown, worlds)}
        return shown, tuple(kept)

    def _allowed(
        self, edit: ObservationEdit, changes: Mapping[str, Any], before: Observation, worlds: Any
    ) -> dict[str, Any]:
        """The changes, moved into the space; in those worlds that are true, None for all."""
        found = {}
        for name, value in changes.items():
            old = before[name]
            if not edit.stays:
                value = self._in_space(edit, name, value, old)
            if worlds is not None:
                value = np.where(beside(worlds, value), value, old)
            # Single worlds' choices are numpy numbers, not arrays of no dimension
            found[name] = value if isinstance(old, np.ndarray) else np.asarray(value)[()]
        return found

    def _in_space(self, edit: ObservationEdit, name: str, value: Any, old: Any) -> Any:
        value = np.asarray(value)
        if value.shape != np.shape(old):
            raise EditError(
                f"'{edit}' makes shape {value.shape} of {name}, which has {np.shape(old)}"
            )
        space = self._space[name]
        if not np.isfinite(value).all():
            raise EditError(f"'{edit}' makes numbers of {name} that are not finite")
        if isinstance(space, spaces.Box):
            value = np.clip(value, space.low, space.high)
        elif isinstance(space, spaces.Discrete):
            value = np.clip(value, space.start, space.start + space.n - 1)
        elif isinstance(space, spaces.MultiBinary):
            value = np.clip(value, 0, 1)
        return value.astype(old.dtype, copy=False)

    def _names(self, edit: ObservationEdit) -> tuple[str, ...]:
        found = tuple(
            dict.fromkeys(name for target in edit.targets for name in names_in(self._space, target))
        )
        edit.when.refuse_names_but(UNITS, "of a moment")
        for name in found:
            edit.check(name, self._space)
        return found
