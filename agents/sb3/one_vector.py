"""Models of one vector, as `MlpPolicy` is given: which observations were strung together in it.

A vector has no names, so all forms in which our observations become one are laid beside it:
`preset="flat"`, and Gymnasium's `FlattenObservation` around an environment with or without
`preset="box"` and `VectorObservations`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
from gymnasium import spaces

from di_envs.config import OBSERVATION_GROUPS
from di_envs.observation import observation_space
from di_envs.presets import Form
from di_envs.vectors import as_vectors, as_vectors_space

Observation = Mapping[str, Any]
_TABLES = tuple(group for group in OBSERVATION_GROUPS if group not in ("camera", "lidar"))


@dataclass(frozen=True, kw_only=True)
class Senses:
    """What a model reads of an observation.

    Attributes:
        groups: Observation groups that hold it.
        options: Options of the environment that go with them: the rig, the LiDAR.
        preset: In which it was trained; empty for none.
        see: From an observation of these groups to what the model takes.
    """

    groups: tuple[str, ...]
    options: Mapping[str, Any]
    preset: str
    see: Callable[[Observation], Any]


def vector_senses(wanted: spaces.Box) -> Senses:
    """The groups and the form whose vector fits a model's space.

    Raises:
        ValueError: If nothing of ours fits; says what it is, and what we offer.
    """
    for groups in _choices():
        raw = observation_space(groups)
        for preset, space, see in _vectors(raw):
            if wanted == space:
                return Senses(groups=groups, options={}, preset=preset, see=see)
    prompt = observation_space(("prompt",))
    known = ", ".join(f"{space.shape}" for _, space, _ in _vectors(prompt))
    raise ValueError(
        f"its observation space is one vector, {described(wanted)}, which none of ours is (of the "
        f"prompt alone: {known}): train it on preset='flat', or with FlattenObservation around "
        f"whole groups of {', '.join(_TABLES)}; frames that were stacked are not taken apart."
    )


def _choices() -> Iterator[tuple[str, ...]]:
    """Groups that can be in a vector, few before many."""
    for count in range(1, len(_TABLES) + 1):
        yield from combinations(_TABLES, count)


def _vectors(
    raw: spaces.Dict,
) -> Iterator[tuple[str, spaces.Space[Any], Callable[[Observation], Any]]]:
    """The forms in which observations of a space are one vector: preset, space, function."""
    flat, box = Form(raw, "flat"), Form(raw, "box")
    yield "flat", flat.space, flat.of
    for form in (box, Form(raw, None)):
        tables: Any = form.space
        yield form.preset or "", *_flattened(tables, form.of)
        scaled = as_vectors_space(tables)
        yield form.preset or "", *_flattened(scaled, partial(_scaled, form, tables))


def _scaled(form: Form, tables: spaces.Dict, seen: Observation) -> dict[str, Any]:
    """What `VectorObservations` makes of a form."""
    return as_vectors(form.of(seen), tables)


def _flattened(
    space: spaces.Dict, of: Callable[[Observation], Observation]
) -> tuple[spaces.Space[Any], Callable[[Observation], Any]]:
    """The space and the function of Gymnasium's `FlattenObservation` behind a form."""
    return spaces.flatten_space(space), lambda seen: spaces.flatten(space, of(seen))


def described(space: spaces.Space[Any] | None) -> str:
    """A space in few words: a table's bounds are those of its last row."""
    if not isinstance(space, spaces.Box):
        return str(space)
    low, high = (np.atleast_1d(bound) for bound in (space.low, space.high))
    rows = [bound.reshape(-1, bound.shape[-1])[-1][:12] for bound in (low, high)]
    ends = [", ".join(f"{value:.3g}" for value in bound.tolist()) for bound in rows]
    return f"{space.shape} {space.dtype}, a row from [{ends[0]}] to [{ends[1]}]"
