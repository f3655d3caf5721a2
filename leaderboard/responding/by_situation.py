"""Mean responses in each situation, with intervals over routes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from leaderboard.responding.claims import common_groups
from leaderboard.responding.drive_responses import DriveResponses
from leaderboard.statistics.bootstrap import (
    BootstrapInterval,
    cluster_sums,
    pooled_mean_interval,
    pooled_ratio_interval,
)

MEASURES = ("Gx", "Gy", "strength", "share")


def by_situation(
    drives: Sequence[DriveResponses], measure: str = "strength"
) -> Mapping[str, Mapping[str, BootstrapInterval]]:
    """Component to situation to the mean response there.

    Args:
        drives: Of one policy.
        measure: One of `MEASURES`.
    """
    groups, routes = common_groups(drives), [drive.route_hash for drive in drives]
    return {
        group: {
            situation: pooled_mean_interval(
                cluster_sums(
                    np.array([_sum(drive, measure, group, situation) for drive in drives], float),
                    routes,
                )
            )
            for situation in drives[0].situations
        }
        for group in groups
    }


def ratios_in(drives: Sequence[DriveResponses], situation: str) -> Mapping[str, BootstrapInterval]:
    """Component to its mean strength in a situation over that in all other moments.

    Empty if the situation never held, or always.
    """
    groups, routes = common_groups(drives), [drive.route_hash for drive in drives]
    holds = [drive.holding(situation) for drive in drives]
    if not any(mask.any() for mask in holds) or all(mask.all() for mask in holds):
        return {}

    def sums(place: int, masks: Sequence[NDArray[np.bool_]]) -> NDArray[np.float64]:
        pairs = [
            (drive.strength[mask, place].sum(), mask.sum())
            for drive, mask in zip(drives, masks, strict=True)
        ]
        return cluster_sums(np.array(pairs, float), routes)

    return {
        group: pooled_ratio_interval(sums(place, holds), sums(place, [~mask for mask in holds]))
        for place, group in enumerate(groups)
    }


def moments_of(drives: Sequence[DriveResponses]) -> Mapping[str, int]:
    """How many moments each situation held at."""
    names = drives[0].situations
    return {name: sum(int(drive.holding(name).sum()) for drive in drives) for name in names}


def _sum(drive: DriveResponses, measure: str, group: str, situation: str) -> tuple[float, float]:
    """Sum and count of a component's responses in a situation."""
    place, holds = drive.groups.index(group), drive.holding(situation)
    if measure in ("Gx", "Gy"):
        values = drive.gradient[:, place, ("Gx", "Gy").index(measure)]
    else:
        values = getattr(drive, measure)[:, place]
    return float(values[holds].sum(dtype=np.float64)), float(holds.sum())
