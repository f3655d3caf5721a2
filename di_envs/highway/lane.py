"""A lane through sampled points for highway-env, also where it bends by more than a right angle.

highway-env's own `PolyLane` takes the last point that lies behind a position, which on a street
that turns back is a point on the wrong arm, a hundred metres aside; this one takes the nearest.
Import this module only where highway-env is wanted: it imports it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from highway_env.road.lane import AbstractLane
from numpy.typing import NDArray


class SampledLane(AbstractLane):
    """A lane of constant width along a line of points.

    Args:
        points: (N, 3) x, y, yaw of the centre line, world frame, N at least 2.
        width: Of the lane [m].
        speed_limit: [m/s].
    """

    def __init__(
        self, points: NDArray[np.float64], width: float, speed_limit: float, priority: int = 0
    ) -> None:
        self._points = np.ascontiguousarray(points[:, :2], np.float64)
        self._yaw = np.ascontiguousarray(points[:, 2], np.float64)
        steps = np.hypot(*np.diff(self._points, axis=0).T)
        self._station = np.concatenate(([0.0], np.cumsum(steps)))
        self.length = float(self._station[-1])
        self.width = width
        self.speed_limit = speed_limit
        self.priority = priority
        self.forbidden = False
        self.line_types = None

    def position(self, longitudinal: float, lateral: float) -> NDArray[np.float64]:
        """The place at a station and an offset to the right; straight on beyond the ends."""
        yaw = self.heading_at(longitudinal)
        x = float(np.interp(longitudinal, self._station, self._points[:, 0]))
        y = float(np.interp(longitudinal, self._station, self._points[:, 1]))
        beyond = longitudinal - min(max(longitudinal, 0.0), self.length)
        return np.array(
            [
                x + beyond * math.cos(yaw) - lateral * math.sin(yaw),
                y + beyond * math.sin(yaw) + lateral * math.cos(yaw),
            ]
        )

    def local_coordinates(self, position: NDArray[np.float64]) -> tuple[float, float]:
        """Station and offset to the right of a place, from the nearest point of the line."""
        x, y = float(position[0]), float(position[1])
        dx, dy = self._points[:, 0] - x, self._points[:, 1] - y
        nearest = int(np.argmin(dx * dx + dy * dy))
        cos, sin = math.cos(self._yaw[nearest]), math.sin(self._yaw[nearest])
        behind = cos * dx[nearest] + sin * dy[nearest]
        left = cos * dy[nearest] - sin * dx[nearest]
        return float(self._station[nearest] - behind), float(-left)

    def heading_at(self, longitudinal: float) -> float:
        """Direction of travel at a station [rad]."""
        return float(np.interp(longitudinal, self._station, self._yaw))

    def width_at(self, longitudinal: float) -> float:
        """The lane's width [m]."""
        return self.width

    @classmethod
    def from_config(cls, config: dict[str, Any]) -> SampledLane:
        """The inverse of `to_config`."""
        return cls(**{**config, "points": np.array(config["points"])})

    def to_config(self) -> dict[str, Any]:
        """All of the lane, ready for JSON."""
        return {
            "class_name": type(self).__name__,
            "config": {
                "points": np.column_stack((self._points, self._yaw)).tolist(),
                "width": self.width,
                "speed_limit": self.speed_limit,
                "priority": self.priority,
            },
        }
