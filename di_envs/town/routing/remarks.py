"""What is odd about a planned route: a keypoint beside its lane, a jump, a long way round.

CARLA plans such routes without a word, so they are planned here too; whoever drives them is told.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from di_envs.town.plan import Remark, RoutePlan
from di_envs.town.routing.snapping import Snap

FAR_M = 5.0  # from a keypoint to its lane
JUMP_M = 10.0  # between two points of a route; a change of lanes takes up to 8 m
DETOUR, DETOUR_M = 4.0, 300.0  # times the straight line, and metres more than it
SHOWN, NAMED = 3, 20  # of the odd routes of a file: those described, those named


class RouteWarning(UserWarning):
    """Routes that can be driven, but hardly are what their author meant."""


def remarks_on(
    keypoints: NDArray[np.float64],
    snaps: Sequence[Snap],
    legs: Sequence[NDArray[np.float64]],
) -> tuple[Remark, ...]:
    """What is odd about a route.

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


def _far(keypoints: NDArray[np.float64], snaps: Sequence[Snap]) -> Iterator[Remark]:
    for i, (keypoint, snap) in enumerate(zip(keypoints, snaps, strict=True)):
        if snap.distance_m <= FAR_M:
            continue
        above_m = float(keypoint[2] - snap.place.points[0, 2])
        height = f", {abs(above_m):.1f} m too {'high' if above_m > 0.0 else 'low'}"
        yield Remark(
            f"keypoint {i} at {text_of(keypoint)} lies {snap.distance_m:.1f} m from its lane"
            f"{height if abs(above_m) > 1.0 else ''}",
            snap.distance_m,
        )


def _jumps(keypoints: NDArray[np.float64], legs: Sequence[NDArray[np.float64]]) -> Iterator[Remark]:
    """Steps inside a leg, and from its end to the beginning of the next."""
    for i, leg in enumerate(legs):
        following = [leg, legs[i + 1][:1]] if i + 1 < len(legs) else [leg]
        step_m = np.linalg.norm(np.diff(np.concatenate(following)[:, :3], axis=0), axis=1)
        if step_m.max(initial=0.0) > JUMP_M:
            yield Remark(
                f"it jumps by {step_m.max():.1f} m between keypoints {i} and {i + 1} "
                f"({text_of(keypoints[i + 1])}): one of them is not on the lane that was meant",
                float(step_m.max()),
            )


def _detours(
    keypoints: NDArray[np.float64], legs: Sequence[NDArray[np.float64]]
) -> Iterator[Remark]:
    for i, leg in enumerate(legs):
        straight_m = float(np.linalg.norm(keypoints[i + 1] - keypoints[i]))
        way_m = float(np.linalg.norm(np.diff(leg[:, :3], axis=0), axis=1).sum())
        if way_m > DETOUR * straight_m and way_m > straight_m + DETOUR_M:
            yield Remark(
                f"from keypoint {i} to {i + 1}, {straight_m:.1f} m apart, it goes {way_m:.0f} m "
                "round: is one of them on the other carriageway?",
                way_m - straight_m,
            )


def odd_routes(plans: Sequence[RoutePlan], file: str) -> str:
    """The odd ones among planned routes, in a few lines, the worst first; empty if none is."""
    odd = [
        (max(plan.remarks, key=lambda remark: remark.off_m), plan) for plan in plans if plan.remarks
    ]
    if not odd:
        return ""
    odd.sort(key=lambda pair: -pair[0].off_m)
    lines = [
        f"{file}: {len(odd)} of {len(plans)} routes look odd, and are driven as they are:",
        *(
            f"route '{plan.route_id}': {worst.text}{_more(len(plan.remarks) - 1)}"
            for worst, plan in odd[:SHOWN]
        ),
    ]
    left = ", ".join(plan.route_id for _, plan in odd[SHOWN : SHOWN + NAMED])
    if left:
        lines.append(f"less so: {left}{_more(len(odd) - SHOWN - NAMED)}")
    return "\n".join(lines)


def _more(count: int) -> str:
    return f" (and {count} more)" if count > 0 else ""


def text_of(position: NDArray[np.float64]) -> str:
    """A place, for messages."""
    x, y, z = position[:3]
    return f"({x:.1f}, {y:.1f}, {z:.1f})"
