"""A route's score as a pure function of its events, its progress and the rules.

Driving score DS = route completion RC (0..100) x infraction score IS (0..1), a product a route; a
benchmark's DS is the mean of these products, never the product of means.
Source: CARLA Leaderboard 1.0 and 2.x (facts about their statistics managers; written anew).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from di_envs.rules import Rules
from di_envs.world.state import EventKind


class Counted(Protocol):
    """All that a score reads of an event."""

    @property
    def kind(self) -> EventKind: ...

    @property
    def value(self) -> float: ...


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a route was driven.

    Attributes:
        done_m: Metres of the dense route completed.
        length_m: Metres of the dense route.
        completed: Whether the rules say that the route was completed.
        travelled_m: Route metres over which the metres outside lanes were counted: CARLA's
            criteria each follow the route by themselves. None for `done_m`.
    """

    done_m: float
    length_m: float
    completed: bool = False
    travelled_m: float | None = None

    def route_completion(self, decimals: int | None = None) -> float:
        """RC in percent, 0..100; 100 for a completed route.

        Args:
            decimals: To which it is rounded; None for not.
        """
        if self.completed:
            return 100.0
        if self.length_m <= 0.0:
            return 0.0
        percent = 100.0 * min(max(self.done_m / self.length_m, 0.0), 1.0)
        return percent if decimals is None else round(percent, decimals)


@dataclass(frozen=True, kw_only=True)
class Score:
    """RC (0..100), IS (0..1) and DS (0..100) of one route."""

    route_completion: float
    infraction_score: float

    @property
    def driving_score(self) -> float:
        return max(self.route_completion * self.infraction_score, 0.0)


def score_route(events: Iterable[Counted], progress: Progress, rules: Rules) -> Score:
    """Scores one route; the order of the events does not change a bit of it.

    Raises:
        ValueError: If there is an event of which the rules say nothing.
    """
    happened = tuple(events)
    for event in happened:
        rules.check(event.kind)
    travelled_m = progress.done_m if progress.travelled_m is None else progress.travelled_m
    counts = Counter(event.kind for event in happened)
    paces = [e.value / 100.0 for e in happened if e.kind == EventKind.MIN_SPEED]
    outside = [
        share_of_distance(e.value, travelled_m)
        for e in happened
        if e.kind == EventKind.OUTSIDE_LANES
    ]
    return Score(
        route_completion=progress.route_completion(rules.completion_decimals),
        infraction_score=rules.penalties.infraction_score(counts, paces, outside),
    )


def share_of_distance(wrong_m: float, travelled_m: float) -> float:
    """The part, 0..1, of the distance travelled that was wrong; all of it if none was travelled."""
    if wrong_m <= 0.0:
        return 0.0
    return min(wrong_m / travelled_m, 1.0) if travelled_m > 0.0 else 1.0


def mean_score(scores: Sequence[Score]) -> tuple[float, float, float]:
    """Means over routes of DS, RC and IS, each by itself.

    Raises:
        ValueError: If there are no scores.
    """
    if not scores:
        raise ValueError("there is no score to take the mean of: no route was driven")
    count = len(scores)
    return (
        math.fsum(score.driving_score for score in scores) / count,
        math.fsum(score.route_completion for score in scores) / count,
        math.fsum(score.infraction_score for score in scores) / count,
    )


def count_infractions(kinds: Iterable[EventKind], rules: Rules) -> Mapping[EventKind, int]:
    """How often each infraction of the rules happened, in CARLA's order, zeros included."""
    counts = Counter(kinds)
    return {kind: counts[kind] for kind in rules.infractions}


def infractions_per_km(count: int, done_m: float) -> float:
    """Infractions per kilometre driven; 0 when nothing was driven."""
    return 1000.0 * count / done_m if done_m > 0.0 else 0.0
