"""A planned route: what the router makes of a route's keypoints, and all that others read of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class RoadOption(IntEnum):
    """CARLA's high-level commands, with CARLA's numbers."""

    VOID = -1
    LEFT = 1
    RIGHT = 2
    STRAIGHT = 3
    LANEFOLLOW = 4
    CHANGELANELEFT = 5
    CHANGELANERIGHT = 6


@dataclass(frozen=True, kw_only=True)
class ScenarioTrigger:
    """Where on a route one of the Leaderboard's scenarios begins.

    Attributes:
        type: The Leaderboard 1.0's number of the scenario: 1, 3, 4, 7, 8, 9 or 10.
        subtype: CARLA's name of the variant, such as `S4left`; empty where there is one only.
        point: Index of the dense route point nearest to its trigger.
    """

    type: int
    subtype: str
    point: int


@dataclass(frozen=True, kw_only=True)
class RoutePlan:
    """A dense route of R points at about 1 m, and its T sparse target points. Read-only.

    The points follow lane centres, so they jump sideways at a lane change, and they may step back
    a little where keypoints join, as CARLA's own do.
    """

    route_id: str
    town: str
    keypoints: NDArray[np.float64]  # (K, 3) x, y, z as given in the route file
    points: NDArray[np.float64]  # (R, 4) x, y, z, yaw; yaw of the lane there
    option: NDArray[np.int8]  # (R,) RoadOption
    lane: NDArray[np.int32]  # (R,) lane index into Lanes
    lane_m: NDArray[np.float64]  # (R,) station along that lane
    route_m: NDArray[np.float64]  # (R,) distance along the route (sum of straight steps), from 0
    targets: NDArray[np.int32]  # (T,) indices of the target points (50 m rule), ascending
    scenarios: tuple[ScenarioTrigger, ...] = ()  # by ascending point, one a point
    geo_origin: tuple[float, float] = (
        0.0,
        0.0,
    )  # of the town: latitude, longitude [deg] of x = y = 0
    remarks: tuple[str, ...] = ()  # what is odd about it, a sentence each

    @property
    def length_m(self) -> float:
        """Length of the dense route."""
        return float(self.route_m[-1])

    @property
    def timeout_s(self) -> float:
        """Game time after which Leaderboard 1.0 ends the route: int(0.8 s/m x length + 5 s)."""
        return float(int(0.8 * self.length_m + 5.0))
