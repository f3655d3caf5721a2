"""`info` of many worlds: arrays, with no dictionary of one world unless somebody asks for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

Info = dict[str, Any]

# Of the rows of `Tally.numbers`, the first ones; those of the reward's terms follow
NUMBERS = (
    "route_completion",
    "infraction_penalty",
    "driving_score",
    "game_time_s",
    "junction_m",
)


class Infos:
    """What a step tells of N worlds beside what they see, as it is put together."""

    def __init__(
        self,
        terms: Sequence[str],
        numbers: NDArray[np.float64],
        route_id: NDArray[np.object_],
        world_seed: NDArray[np.int64],
    ) -> None:
        """Of steps in which nothing happened.

        Args:
            terms: Names of the reward's terms.
            numbers: (C, N) those of `NUMBERS`, then the terms; kept and changed, as are the rest.
            route_id: (N,) of the routes.
            world_seed: (N,).
        """
        self._worlds = world_seed.size
        self._terms = dict(zip(terms, numbers[len(NUMBERS) :], strict=True))
        self._arrays: Info = {
            "route_id": route_id,
            "world_seed": world_seed,
            **dict(zip(NUMBERS, numbers, strict=False)),
            "reward_terms": self._terms,
            "events": np.fromiter(repeat((), self._worlds), object, self._worlds),
            "finished": np.fromiter(repeat("", self._worlds), object, self._worlds),
        }

    def put(self, index: int, info: Info) -> None:
        """Takes over what one world tells."""
        for name, array in self._arrays.items():
            if name == "reward_terms":
                for term, terms in self._terms.items():
                    terms[index] = info[name][term]
            else:
                array[index] = info[name]

    def row(self, index: int) -> Info:
        """One world's `info`, as a single environment gives it."""
        return _row(self._arrays, index)

    def batched(self) -> Info:
        """All worlds', as Gymnasium has it: each array with a mask of who has the entry."""
        masks = iter(np.ones((len(self._arrays) + len(self._terms), self._worlds), bool))
        found: Info = {}
        for name, array in self._arrays.items():
            if name == "reward_terms":
                terms: Info = {}
                for term, values in self._terms.items():
                    terms[term], terms[f"_{term}"] = values, next(masks)
                array = terms
            found[name], found[f"_{name}"] = array, next(masks)
        return found


def _row(arrays: Info, index: int) -> Info:
    """One entry of each array, as Python's own kinds of numbers."""
    found: Info = {}
    for name, array in arrays.items():
        nested = isinstance(array, dict)
        found[name] = _row(array, index) if nested else array[[index]].tolist()[0]
    return found


def infos_of(
    begun: Mapping[int, Info], worlds: int, add: Callable[[Info, Info, int], Info]
) -> Info:
    """`info` of the worlds that were reset, as Gymnasium batches it.

    Args:
        begun: What each of them tells.
        worlds: How many there are.
        add: Gymnasium's `VectorEnv._add_info`, which leaves out the others.
    """
    if len(begun) == worlds:
        return _batched([begun[index] for index in range(worlds)])
    batched: Info = {}
    for index in sorted(begun):
        batched = add(batched, begun[index], index)
    return batched


def _batched(infos: Sequence[Info]) -> Info:
    """What `VectorEnv._add_info` makes of infos that all have the same keys, in less time."""
    batched: Info = {}
    for key, first in infos[0].items():
        values = [info[key] for info in infos]
        if isinstance(first, dict):
            batched[key] = _batched(values)
        elif type(first) in (int, float, bool):
            batched[key] = np.array(values, type(first))
        else:
            batched[key] = np.fromiter(values, object, len(values))
        batched[f"_{key}"] = np.ones(len(infos), bool)
    return batched
