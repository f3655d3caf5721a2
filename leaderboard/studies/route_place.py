"""Where on its route a recorded ego is, and how far beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from di_envs.town.plan import RoutePlan
from leaderboard.records.record import TraceRow

_AHEAD, _BEHIND = 60, 5  # route points among which the next place is looked for
_OTHER_WAY_M = 10.0  # a point where the route goes the other way counts as so much further off


class RoutePlace:
    """Follows an ego along its route, which may cross itself: the next place is near the last.

    Attributes:
        index: Of the route point beside which it is.
        route_m: That point's distance along the route.
        lateral_m: How far right of it the ego is.
    """

    def __init__(self, plan: RoutePlan) -> None:
        self._plan = plan
        self.index, self.route_m, self.lateral_m = 0, 0.0, 0.0

    def move(self, x: float, y: float, yaw: float) -> None:
        """The ego is here now (world frame)."""
        points = self._plan.points
        first = max(self.index - _BEHIND, 0)
        near = points[first : self.index + _AHEAD]
        off = np.hypot(near[:, 0] - x, near[:, 1] - y)
        off += _OTHER_WAY_M * (np.cos(near[:, 3] - yaw) < 0.0)
        self.index = first + int(np.argmin(off))
        px, py, _, course = points[self.index]
        dx, dy = x - px, y - py
        self.route_m = float(self._plan.route_m[self.index])
        self.lateral_m = dy * math.cos(course) - dx * math.sin(course)


def offsets(
    trace: Sequence[TraceRow], plan: RoutePlan
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far right of its route an ego was, along the route.

    Args:
        trace: Rows of time, x, y, z, yaw, speed, as a record keeps them.
        plan: The route.

    Returns:
        (N,) metres along the route, ascending, and (N,) metres to the right there.
    """
    place = RoutePlace(plan)
    along: list[float] = []
    beside: list[float] = []
    for _, x, y, _, yaw, _ in trace:
        place.move(x, y, yaw)
        if not along or place.route_m > along[-1]:  # standing, or a step back, says nothing new
            along.append(place.route_m)
            beside.append(place.lateral_m)
    return np.array(along), np.array(beside)
