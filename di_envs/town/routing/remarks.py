"""What is odd about a planned route: a keypoint beside its lane, a jump, a long way round.

CARLA plans such routes without a word, so they are planned here too; whoever drives them is told.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from di_envs.town.routing.snapping import Snap

FAR_M = 5.0  # from a keypoint to its lane
JUMP_M = 10.0  # between two points of a route; a change of lanes takes up to 8 m
DETOUR, DETOUR_M = 4.0, 300.0  # times the straight line, and metres more than it


class RouteWarning(UserWarning):
    """Routes that can be driven, but hardly are what their author meant."""


def remarks_on(
    keypoints: NDArray[np.float64],
    snaps: Sequence[Snap],
    legs: Sequence[NDArray[np.float64]],
) -> tuple[str, ...]:
    """What is odd about a route, a sentence each that names the keypoint.

    Args:
        keypoints: (K, 3) x, y, z [m].
        snaps: Their K places on lanes.
        legs: Points (N, 3 or more) of the K - 1 legs between them.
    """
    return (
        *_far(keypoints, snaps),
        *_jumps(keypoints, legs),
        *_detours(keypoints, legs),
    )


def _far(keypoints: NDArray[np.float64], snaps: Sequence[Snap]) -> Iterator[str]:
    for i, (keypoint, snap) in enumerate(zip(keypoints, snaps, strict=True)):
        if snap.distance_m <= FAR_M:
            continue
        above_m = float(keypoint[2] - snap.place.points[0, 2])
        height = f", {abs(above_m):.1f} m too {'high' if above_m > 0.0 else 'low'}"
        yield (
            f"keypoint {i} at {text_of(keypoint)} lies {snap.distance_m:.1f} m from its lane"
            f"{height if abs(above_m) > 1.0 else ''}"
        )


def _jumps(keypoints: NDArray[np.float64], legs: Sequence[NDArray[np.float64]]) -> Iterator[str]:
    """Steps inside a leg, and from its end to the beginning of the next."""
    for i, leg in enumerate(legs):
        following = [leg, legs[i + 1][:1]] if i + 1 < len(legs) else [leg]
        step_m = np.linalg.norm(np.diff(np.concatenate(following)[:, :3], axis=0), axis=1)
        if step_m.max(initial=0.0) > JUMP_M:
            yield (
                f"it jumps by {step_m.max():.1f} m between keypoints {i} and {i + 1} "
                f"({text_of(keypoints[i + 1])}): one of them is not on the lane that was meant"
            )


def _detours(keypoints: NDArray[np.float64], legs: Sequence[NDArray[np.float64]]) -> Iterator[str]:
    for i, leg in enumerate(legs):
        straight_m = float(np.linalg.norm(keypoints[i + 1] - keypoints[i]))
        way_m = float(np.linalg.norm(np.diff(leg[:, :3], axis=0), axis=1).sum())
        if way_m > DETOUR * straight_m and way_m > straight_m + DETOUR_M:
            yield (
                f"from keypoint {i} to {i + 1}, {straight_m:.1f} m apart, it goes {way_m:.0f} m "
                "round: is one of them on the other carriageway?"
            )


def text_of(position: NDArray[np.float64]) -> str:
    """A place, for messages."""
    x, y, z = position[:3]
    return f"({x:.1f}, {y:.1f}, {z:.1f})"
