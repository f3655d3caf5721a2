"""Which route each of several egos drives: no two of them start near each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from di_envs.course import Course
from di_envs.numerics.keyed_random import Stream, keyed_hash

START_APART_M = 12.0  # between two egos' starts: a vehicle's length and room to see it


class RoutesApart:
    """Chooses a route of a course for each ego."""

    def __init__(self, course: Course, egos: int) -> None:
        """Of the routes that the course has."""
        self._course, self._plans, self._egos = course, course.plans, egos

    def drawn(self, seed: int) -> list[int]:
        """A route's index for each ego, drawn on its own key; the next one where a start is taken.

        Raises:
            ValueError: If too few routes start apart.
        """
        chosen: list[int] = []
        count = len(self._plans)
        for ego in range(self._egos):
            draw = int(keyed_hash(seed, int(Stream.ROUTE), 0, ego)) % count
            order = [(draw + further) % count for further in range(count)]
            free = [index for index in order if self._too_near(index, chosen) is None]
            if not free:
                raise ValueError(
                    f"Only {ego} of the {count} routes start {START_APART_M:g} m apart, and there "
                    f"are {self._egos} egos. Take fewer, or a suite of more routes."
                )
            chosen.append(free[0])
        return chosen

    def given(self, routes: Sequence[Any]) -> list[int]:
        """The indices of routes that the caller names, one an ego, by id or index.

        Raises:
            ValueError: If one is unknown, there are more or fewer than egos, or two start near
                each other.
        """
        if isinstance(routes, str) or len(routes) != self._egos:
            raise ValueError(
                f"options['routes'] names {self._egos} routes, one an ego; got {routes!r}."
            )
        chosen: list[int] = []
        for route in routes:
            index = self._course.route_index(route)
            other = self._too_near(index, chosen)
            if other is not None:
                names = self._course.route_ids
                raise ValueError(
                    f"Routes '{names[other]}' and '{names[index]}' start less than "
                    f"{START_APART_M:g} m apart; choose others."
                )
            chosen.append(index)
        return chosen

    def _too_near(self, index: int, chosen: list[int]) -> int | None:
        """The one of the chosen routes whose start is too near that of another, if there is one."""
        start = self._plans[index].points[0, :3]
        for other in chosen:
            if np.linalg.norm(self._plans[other].points[0, :3] - start) < START_APART_M:
                return other
        return None
