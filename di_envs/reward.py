"""The reward: how much the driving score, in metres, grew in a step, as named terms.

Score in metres = route metres done x (1 - share of them outside the lanes) x infraction score so
far. A step's reward is its growth, so an episode's return is its driving score in metres,
`route length x driving score / 100`: what the Leaderboard counts is what is learned. The terms add
up to the reward as follows: progress first, then metres outside, both at the infraction score
before the step, then each kind of infraction.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from di_envs.numerics.arrays import Float64, Int32
from di_envs.rules.penalties import Penalties
from di_envs.world.event_names import EVENT_KEYS
from di_envs.world.state import EventKind


class Standing(NamedTuple):
    """How far an ego has come, and what it has done wrong."""

    done_m: float  # metres of the dense route completed
    outside_share: float  # of the route metres so far, outside the lanes or against them, 0..1
    counts: tuple[int, ...]  # events so far, by EventKind
    pace_shares: tuple[float, ...] = ()  # at checkpoints, of the traffic's mean speed, 0..1


class Marks(Protocol):
    """What a standing is read off: a state, or what was noted of many, with an axis E of egos."""

    @property
    def route_done_m(self) -> Float64:
        """(E,) metres of the dense route completed."""

    @property
    def outside_m(self) -> Float64:
        """(E,) route metres outside lanes or against them."""

    @property
    def outside_done_m(self) -> Float64:
        """(E,) route metres over which they were counted."""

    @property
    def counts(self) -> Int32:
        """(E, EVENT_KINDS) events so far."""

    @property
    def pace_share(self) -> Float64:
        """(E, CHECKPOINTS) ego's share of the traffic's pace."""


def standing_of(state: Marks, ego: int) -> Standing:
    """An ego's standing in the present state."""
    outside_m = float(state.outside_m[ego])
    # Counted over route points of its own, as CARLA does: nearly, not exactly, the metres done.
    share = min(outside_m / float(state.outside_done_m[ego]), 1.0) if outside_m > 0.0 else 0.0
    counts = tuple(state.counts[ego].tolist())
    pace_shares = tuple(state.pace_share[ego].tolist()) if counts[EventKind.MIN_SPEED] else ()
    return Standing(float(state.route_done_m[ego]), share, counts, pace_shares)


def inside_metres(standing: Standing) -> float:
    """Route metres done, less the share outside the lanes."""
    return standing.done_m * (1.0 - standing.outside_share)


def infraction_penalty(standing: Standing, penalties: Penalties) -> float:
    """The infraction score so far, 1 for none; metres outside are not in it."""
    return penalties.infraction_score(standing.counts, standing.pace_shares)


def score_metres(standing: Standing, penalties: Penalties) -> float:
    """The driving score in metres of the route: what a step's reward is the growth of."""
    return inside_metres(standing) * infraction_penalty(standing, penalties)


def term_names(penalties: Penalties) -> tuple[str, ...]:
    """Names of the reward's terms, in their order."""
    return ("progress", "outside_lanes", *penalties.no_terms)


def reward_terms(before: Standing, after: Standing, penalties: Penalties) -> dict[str, float]:
    """The reward of a step, taken apart; its terms add up to the growth of `score_metres`.

    Args:
        before: Standing at the step's start.
        after: Standing at its end.
        penalties: What infractions cost.

    Returns:
        `progress` and `outside_lanes` [m, times the infraction score before], then one term a kind
        of infraction, named as the event: what the infraction takes of the score, 0 or negative.
    """
    penalty = infraction_penalty(before, penalties)
    progress_m = after.done_m - before.done_m
    inside_m = inside_metres(after)
    terms = {
        "progress": progress_m * penalty,
        "outside_lanes": (inside_m - inside_metres(before) - progress_m) * penalty,
    }
    terms |= penalties.no_terms
    if after.counts == before.counts:
        return terms
    score = inside_m * penalty
    seen = before
    for kind in penalties.scored:
        if after.counts[kind] != before.counts[kind]:
            seen = _with_kind(seen, after, kind)
            left = inside_m * infraction_penalty(seen, penalties)
            terms[EVENT_KEYS[kind]] = left - score
            score = left
    return terms


def _with_kind(standing: Standing, after: Standing, kind: EventKind) -> Standing:
    """The standing, with infractions of one kind as they are afterwards."""
    if kind == EventKind.MIN_SPEED:
        return standing._replace(pace_shares=after.pace_shares)
    counts = list(standing.counts)
    counts[kind] = after.counts[kind]
    return standing._replace(counts=tuple(counts))
