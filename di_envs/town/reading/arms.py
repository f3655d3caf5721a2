"""The arms of junctions: the approach lanes of an incoming road, and how arms lie to each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import LaneKind, Lanes

# Arms are counted clockwise from south-east, where the streets of few towns come from: those from
# the west do not turn from first to last by a hair.
_FIRST_ANGLE_RAD = 0.25 * np.pi
_OPPOSED_COSINE = -0.7  # the two arms of a through road look at each other
_POLE_GAP_M = 0.6  # from the road's edge to a signal's pole
_PAVED = (LaneKind.DRIVING, LaneKind.PARKING, LaneKind.SHOULDER, LaneKind.BIKING)


@dataclass(frozen=True, kw_only=True)
class Arm:
    """One way into a junction."""

    junction: int
    lanes: tuple[int, ...]  # driving lanes that end there, from left to right
    end: NDArray[np.float64]  # (4,) x, y, z, yaw: middle of their ends
    half_width_m: float  # of all of them together

    def ahead_right(self, x: float, y: float) -> tuple[float, float]:
        """A world point relative to the middle of the arm's end (ahead, right) [m]."""
        dx, dy, yaw = x - self.end[0], y - self.end[1], self.end[3]
        c, s = float(np.cos(yaw)), float(np.sin(yaw))
        return c * dx + s * dy, c * dy - s * dx

    def place(self, ahead_m: float, right_m: float) -> NDArray[np.float64]:
        """(4,) x, y, z, yaw of a point relative to the middle of the arm's end."""
        x, y, z, yaw = self.end
        c, s = np.cos(yaw), np.sin(yaw)
        return np.array(
            [x + c * ahead_m - s * right_m, y + s * ahead_m + c * right_m, z, yaw], dtype=np.float64
        )


def junction_centres(lanes: Lanes, count: int) -> NDArray[np.float64]:
    """(J, 2) x, y: middles of the boxes around the driving lanes of each junction."""
    centres = np.full((count, 2), np.nan)
    inside = lanes.junction[lanes.point_lane]
    driving = lanes.kind[lanes.point_lane] == LaneKind.DRIVING
    for junction in range(count):
        points = lanes.points[(inside == junction) & driving, :2]
        if len(points):
            centres[junction] = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return centres


def junction_arms(lanes: Lanes, count: int) -> list[list[Arm]]:
    """For each junction its arms, clockwise by the place that they come from."""
    members: dict[tuple[int, int, bool], list[int]] = {}
    for lane in np.flatnonzero(lanes.kind == LaneKind.DRIVING):
        junction = approached_junction(lanes, int(lane))
        if junction >= 0:
            # A loop may come to its junction by both ends: its two directions are two arms.
            key = (junction, int(lanes.road[lane]), bool(lanes.lane_id[lane] > 0))
            members.setdefault(key, []).append(int(lane))
    centres = junction_centres(lanes, count)
    arms: list[list[Arm]] = [[] for _ in range(count)]
    for (junction, _, _), own in members.items():
        arms[junction].append(make_arm(lanes, junction, own))
    for junction, group in enumerate(arms):
        angles = [_clockwise(arm.end[:2] - centres[junction]) for arm in group]
        arms[junction] = [group[k] for k in np.argsort(angles, kind="stable")]
    return arms


def approached_junction(lanes: Lanes, lane: int) -> int:
    """The junction that a lane outside of it leads into, or -1."""
    if lanes.junction[lane] >= 0:
        return -1
    ahead = lanes.successor[lanes.successor_start[lane] : lanes.successor_start[lane + 1]]
    inside = lanes.junction[ahead]
    return int(inside.max()) if len(inside) else -1


def make_arm(lanes: Lanes, junction: int, members: list[int]) -> Arm:
    """An arm of the given approach lanes of a junction."""
    ends = np.array([_end_of(lanes, lane) for lane in members])
    yaw = np.arctan2(np.sin(ends[:, 3]).mean(), np.cos(ends[:, 3]).mean())
    right = ends[:, 1] * np.cos(yaw) - ends[:, 0] * np.sin(yaw)
    half = np.array([0.5 * stop_width(lanes, lane) for lane in members])
    low, high = (right - half).min(), (right + half).max()
    centre = ends[:, :3].mean(axis=0)
    shift = 0.5 * (low + high) - right.mean()
    centre[:2] += shift * np.array([-np.sin(yaw), np.cos(yaw)])
    return Arm(
        junction=junction,
        lanes=tuple(members[k] for k in np.argsort(right, kind="stable")),
        end=np.append(centre, yaw),
        half_width_m=float(0.5 * (high - low)),
    )


def stop_width(lanes: Lanes, lane: int) -> float:
    """Width of a lane at its end [m]."""
    return float(lanes.width_m[lanes.first[lane] + lanes.count[lane] - 1])


def stem_of(arms: list[Arm]) -> list[Arm]:
    """The arms of a T that the through road passes: those beside the two that are most opposed.

    Empty where no two arms look at each other: a fork or a merge.
    """
    pairs = [
        (float(np.cos(a.end[3] - b.end[3])), i, j)
        for i, a in enumerate(arms)
        for j, b in enumerate(arms[:i])
    ]
    if not pairs or min(pairs)[0] > _OPPOSED_COSINE:
        return []
    _, i, j = min(pairs)
    return [arm for k, arm in enumerate(arms) if k not in (i, j)]


def pole_place(lanes: Lanes, arm: Arm, ahead_m: float) -> tuple[float, float]:
    """Where a signal's pole stands: (ahead, right) of the arm's end, beyond the road's edge [m].

    That is the right edge where one drives on the right, and the left one where on the left.
    """
    outward = 1.0 if _drives_on_the_right(lanes, arm.lanes[0]) else -1.0
    last = arm.lanes[-1] if outward > 0.0 else arm.lanes[0]
    station = lanes.road_m[lanes.first[last] + lanes.count[last] - 1]
    edge = arm.half_width_m
    same_side = (
        (lanes.road == lanes.road[last])
        & ((lanes.lane_id > 0) == (lanes.lane_id[last] > 0))
        & np.isin(lanes.kind, _PAVED)
    )
    for lane in np.flatnonzero(same_side):
        own = slice(lanes.first[lane], lanes.first[lane] + lanes.count[lane])
        nearest = int(np.argmin(np.abs(lanes.road_m[own] - station))) + lanes.first[lane]
        if abs(lanes.road_m[nearest] - station) < 1.0:
            _, right = arm.ahead_right(*lanes.points[nearest, :2])
            edge = max(edge, outward * right + 0.5 * float(lanes.width_m[nearest]))
    return ahead_m, outward * (edge + _POLE_GAP_M)


def _drives_on_the_right(lanes: Lanes, lane: int) -> bool:
    """Whether lanes of negative ids run along growing stations of their road, as on the right."""
    first = int(lanes.first[lane])
    along = lanes.road_m[first + int(lanes.count[lane]) - 1] >= lanes.road_m[first]
    return bool(along == (lanes.lane_id[lane] < 0))


def _end_of(lanes: Lanes, lane: int) -> NDArray[np.float64]:
    end: NDArray[np.float64] = lanes.points[lanes.first[lane] + lanes.count[lane] - 1]
    return end


def _clockwise(offset: NDArray[np.float64]) -> float:
    angle = np.arctan2(offset[1], offset[0]) - _FIRST_ANGLE_RAD
    return float(angle % (2.0 * np.pi))
