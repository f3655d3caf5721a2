"""Thins out a route as the CARLA Leaderboard does, for agents that keep the dense one too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from di_envs.town.routing.router import target_indices


def downsample_route(route: Sequence[tuple[Any, Any]], sample_factor: float) -> list[int]:
    """Indices of the points to keep.

    Kept are every lane-change point, every point where the option changes (unless a lane change
    came just before), the first point more than `sample_factor` metres after the last kept one, and
    the last.

    Args:
        route: Transforms (or what has their `location`), each with its `RoadOption`.
        sample_factor: Metres.
    """
    if not route:
        return []
    places = [transform.location for transform, _ in route]
    points = np.array([(place.x, place.y, place.z) for place in places], np.float64)
    options = np.array([int(getattr(option, "value", option)) for _, option in route], np.int8)
    return target_indices(points, options, sample_factor).tolist()
