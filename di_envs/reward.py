"""The reward: how much the driving score, in metres, grew in a step, as named terms.

Score in metres = route metres done x (1 - share of them outside the lanes) x penalty of each
infraction so far. A step's reward is its growth, so an episode's return is its driving score in
metres, `route length x driving score / 100`: what the Leaderboard counts is what is learned. The
terms add up to the reward as follows: progress first, then metres outside, both at the penalty
before the step, then each infraction.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from di_envs.world.state import EventKind, State

# Source: CARLA Leaderboard 1.0, statistics manager. Each event multiplies the penalty.
PENALTIES: Mapping[str, Mapping[EventKind, float]] = MappingProxyType(
    {
        "carla-1.0": MappingProxyType(
            {
                EventKind.COLLISION_WALKER: 0.50,
                EventKind.COLLISION_VEHICLE: 0.60,
                EventKind.COLLISION_STATIC: 0.65,
                EventKind.RED_LIGHT: 0.70,
                EventKind.STOP_SIGN: 0.80,
            }
        )
    }
)


class Standing(NamedTuple):
    """How far an ego has come, and what it has done wrong."""

    done_m: float  # metres of the dense route completed
    outside_share: float  # of the route metres so far, outside the lanes or against them, 0..1
    counts: tuple[int, ...]  # events so far, by EventKind


def standing_of(state: State, ego: int) -> Standing:
    """An ego's standing in the present state."""
    outside_m = float(state.outside_m[ego])
    # Counted over route points of its own, as CARLA does: nearly, not exactly, the metres done.
    share = min(outside_m / float(state.outside_done_m[ego]), 1.0) if outside_m > 0.0 else 0.0
    counts = tuple(state.counts[ego].tolist())
    return Standing(float(state.route_done_m[ego]), share, counts)


def inside_metres(standing: Standing) -> float:
    """Route metres done, less the share outside the lanes."""
    return standing.done_m * (1.0 - standing.outside_share)


def infraction_penalty(standing: Standing, penalties: Mapping[EventKind, float]) -> float:
    """The product over all infractions so far, 1 for none; metres outside are not in it."""
    penalty = 1.0
    for kind, factor in penalties.items():
        penalty *= factor ** standing.counts[kind]
    return penalty


def score_metres(standing: Standing, penalties: Mapping[EventKind, float]) -> float:
    """The driving score in metres of the route: what a step's reward is the growth of."""
    return inside_metres(standing) * infraction_penalty(standing, penalties)


def reward_terms(
    before: Standing, after: Standing, penalties: Mapping[EventKind, float]
) -> dict[str, float]:
    """The reward of a step, taken apart; its terms add up to the growth of `score_metres`.

    Args:
        before: Standing at the step's start.
        after: Standing at its end.
        penalties: Factor of each kind of infraction.

    Returns:
        `progress` and `outside_lanes` [m, times the penalty before], then one term a kind of
        infraction, named as the event: what the infraction takes of the score, 0 or negative.
    """
    penalty = infraction_penalty(before, penalties)
    progress_m = after.done_m - before.done_m
    inside_m = inside_metres(after)
    terms = {
        "progress": progress_m * penalty,
        "outside_lanes": (inside_m - inside_metres(before) - progress_m) * penalty,
    }
    score = inside_m * penalty
    for kind, factor in penalties.items():
        left = score * factor ** (after.counts[kind] - before.counts[kind])
        terms[kind.name.lower()] = left - score
        score = left
    return terms
