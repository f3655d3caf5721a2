"""What many worlds see and are told, as arrays with a leading axis of worlds.

Prompts are written by their kernels straight into rows of one set of arrays, and copied together:
ten copies a step, not ten a world.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import create_empty_array

from di_envs.observer import Observer, prompt_observation
from di_envs.prompt import COMPONENTS, Prompt, empty_prompt

Rows = dict[str, Any]


class WorldRows:
    """The observations of N worlds; keeps nothing but the buffers that prompts are written to."""

    def __init__(self, space: spaces.Dict, observers: Sequence[Observer]) -> None:
        """Takes over where the observers write their prompts, from their next episodes on.

        Args:
            space: Of one world's observations.
            observers: One a world.
        """
        self._observers = observers
        self._prompts: Prompt | None = None
        names = {*COMPONENTS, "prompt_present"}
        if names <= set(space.spaces):
            self._prompts = prompts = empty_prompt(len(observers))
            for index, observer in enumerate(observers):
                observer.write_prompt_to(Prompt(*(part[index] for part in prompts)))
        else:
            names = set()
        self._sensors = spaces.Dict(
            {name: part for name, part in space.spaces.items() if name not in names}
        )

    def fresh(self) -> Rows:
        """New arrays for what sensors see, yet to be filled; prompts are added at the end."""
        rows: Any = create_empty_array(self._sensors, n=len(self._observers), fn=np.empty)
        return dict(rows)

    def look(self, rows: Rows, index: int) -> None:
        """Has a world's prompt written to its buffer, and what sensors see to its rows."""
        self._observers[index].write_tables()
        self.measure(rows, index)

    @property
    def with_sensors(self) -> bool:
        """Whether there is more to see than prompts."""
        return bool(self._sensors.spaces)

    def measure(self, rows: Rows, index: int) -> None:
        """Writes what a world's sensors see to its rows; its tables are written already."""
        self.write(rows, index, self._observers[index].measure())

    def write(self, rows: Rows, index: int, observation: Rows) -> None:
        """Copies what a world's sensors have seen to its rows."""
        for name in self._sensors.spaces:
            rows[name][index] = observation[name]

    def add_prompts(self, rows: Rows) -> None:
        """Adds copies of all prompts, once every world's is written."""
        if self._prompts is not None:
            rows |= prompt_observation(self._prompts)
            rows["command"] = rows["command"][:, 0]


def row_of(batch: Any, index: int) -> Any:
    """One world's entry of each array, or of the only one, which later writing leaves as it is."""
    if isinstance(batch, dict):
        return {name: row_of(array, index) for name, array in batch.items()}
    row = batch[index]
    return row.copy() if isinstance(row, np.ndarray) else row
