"""Forms of observations for learning libraries: Boxes alone, or one vector.

Most libraries want numbers of one kind and refuse a choice or a set of flags among them.
`preset="box"` gives each entry as a Box: tables as they are, a choice as ones and zeros, flags as
numbers, all in single precision; images stay images. `preset="flat"` gives one vector: the prompt
as `prompt_numbers` reads it, then every other entry as `vectors` scales it.

A form is made of a space alone, so an environment that shows it and an agent that learned from it
see the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from di_envs.config import PRESETS
from di_envs.files.names import check_name
from di_envs.prompt import COMPONENTS
from di_envs.prompt_numbers import KEYS, flat_numbers, prompt_numbers
from di_envs.vectors import scale_of

FLAT_LIMIT = 20.0  # no number of a flat vector is larger: 100 m of length or width, over 5
_PROMPT = frozenset({*COMPONENTS, "prompt_present"})


class Form:
    """A preset of observations of one space; keeps nothing but what the space says.

    Attributes:
        preset: One of `PRESETS`; None shows observations as they are.
        space: Of what it shows.
    """

    def __init__(self, raw: spaces.Dict, preset: str | None) -> None:
        """Works out the space.

        Args:
            raw: Of one world's observations, as they are.
            preset: One of `PRESETS`, or None.

        Raises:
            ValueError: If there is no such preset, or an entry has no place in it.
        """
        if preset is not None:
            check_name(preset, PRESETS, "preset")
        self.preset = preset
        self._raw = raw.spaces
        self.space: spaces.Space[Any] = raw
        if preset is None:
            return
        self._boxes = {name: box_space(part) for name, part in raw.spaces.items()}
        if preset == "box":
            self.space = spaces.Dict(dict[str, spaces.Space[Any]](self._boxes))
            return
        self._reads_prompt = raw.spaces.keys() >= set(KEYS)
        self._scales = {
            name: (len(part.shape), scale_of(part))
            for name, part in self._boxes.items()
            if not (self._reads_prompt and name in _PROMPT)
        }
        self.space = self._flat_space()

    def of(self, observation: Mapping[str, Any]) -> Any:
        """An observation in this form.

        Args:
            observation: Of one world, or (..., *shape) of many, as it is.

        Returns:
            Itself, a Dict's value of arrays (`box`), or an array (..., numbers) float32 (`flat`).
        """
        if self.preset is None:
            return observation
        boxes = {name: as_box(observation[name], part) for name, part in self._raw.items()}
        return boxes if self.preset == "box" else self._flat(boxes)

    def _flat_space(self) -> spaces.Box:
        whole = [name for name, part in self._boxes.items() if part.dtype != np.float32]
        if whole:
            raise ValueError(
                f"preset='flat' is a vector of real numbers, and {', '.join(whole)} holds whole "
                f"ones: take preset='box', or no images and no tags of points."
            )
        zeros = {name: np.zeros(part.shape, np.float32) for name, part in self._boxes.items()}
        return spaces.Box(-FLAT_LIMIT, FLAT_LIMIT, self._flat(zeros).shape, np.float32)

    def _flat(self, boxes: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
        """(..., numbers): the prompt's first, then the other entries in the order of the space."""
        parts = []
        if self._reads_prompt:
            parts.append(flat_numbers(prompt_numbers(boxes, np), np))
        for name, (axes, scale) in self._scales.items():
            values = boxes[name]
            parts.append((values / scale).reshape((*values.shape[: values.ndim - axes], -1)))
        return np.concatenate(parts, axis=-1, dtype=np.float32)


def box_space(space: spaces.Space[Any]) -> spaces.Box:
    """One entry's Box: real numbers in single precision, whole ones as they are."""
    if isinstance(space, spaces.Discrete):
        return spaces.Box(0.0, 1.0, (int(space.n),), np.float32)
    if isinstance(space, spaces.MultiBinary):
        return spaces.Box(0.0, 1.0, space.shape, np.float32)
    assert isinstance(space, spaces.Box)
    if np.issubdtype(space.dtype, np.floating):
        low, high = space.low.astype(np.float32), space.high.astype(np.float32)
        return spaces.Box(low, high, dtype=np.float32)
    return space


def as_box(value: Any, space: spaces.Space[Any]) -> NDArray[Any]:
    """One entry's value in its Box, with the leading axes that it has; `space` is as it is."""
    if isinstance(space, spaces.Discrete):
        choices: NDArray[Any] = np.eye(int(space.n), dtype=np.float32)[np.asarray(value)]
        return choices
    if isinstance(space, spaces.MultiBinary) or np.issubdtype(space.dtype, np.floating):
        return np.asarray(value, np.float32)
    return np.asarray(value)
