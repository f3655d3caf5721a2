"""Which situation a moment is: read off the true prompt, whatever the agent was shown of it.

Situations overlap: a turn in a junction is both. All is judged along the route: who stands beside
it is no obstacle, and a light of the road across is not one's own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

SITUATIONS = ("junction", "turning", "obstacle", "light", "stop_sign", "free")

# What each means, for tables and figures
SAYS: Mapping[str, str] = {
    "junction": "in a junction",
    "turning": "the route bends by 20° or more within 12 m",
    "obstacle": "somebody on the route within 20 m",
    "light": "a stop line with a light on the route within 25 m, whatever it shows",
    "stop_sign": "a stop line with a sign on the route within 25 m",
    "free": "none of these, and no junction within 25 m",
}

TURN_M, TURN_RAD = 12.0, np.deg2rad(20.0)
OBSTACLE_M, OBSTACLE_SIDE_M = 20.0, 0.5  # what reaches nearer than this to the route is on it
EGO_HALF_WIDTH_M = 1.0
STOP_LINE_M, STOP_LINE_SIDE_M, STOP_LINE_RAD = 25.0, 2.0, np.deg2rad(45.0)
_X, _Y, _YAW = 0, 1, 2


def situations_of(prompt: Mapping[str, Any], junction_m: float) -> dict[str, bool]:
    """Which situations a moment is.

    Args:
        prompt: The true prompt: `routing`, `obstacles`, `traffic_lights` and `stop_signs` as in the
            observation space.
        junction_m: Along the route to the next junction; 0 in one.

    Returns:
        Every name of `SITUATIONS` to whether it holds.
    """
    routing = np.asarray(prompt["routing"], np.float64)
    route = routing[routing[:, 3] > 0.0]
    found = {
        "junction": junction_m <= 0.0,
        "turning": turns(route),
        "obstacle": obstacle_on(route, np.asarray(prompt["obstacles"], np.float64)),
        "light": stop_line_on(route, np.asarray(prompt["traffic_lights"], np.float64)),
        "stop_sign": stop_line_on(route, np.asarray(prompt["stop_signs"], np.float64)),
    }
    found["free"] = not any(found.values()) and junction_m > STOP_LINE_M
    return found


def turns(route: NDArray[np.float64]) -> bool:
    """Whether the next points of a route, (R, 4+) x, y, yaw at 1 m, bend."""
    yaw = np.unwrap(route[: round(TURN_M), _YAW])
    return bool(yaw.size and np.ptp(yaw) >= TURN_RAD)


def obstacle_on(route: NDArray[np.float64], obstacles: NDArray[np.float64]) -> bool:
    """Whether one of (K, 9) obstacles reaches into the ego's width along the route."""
    near = route[: round(OBSTACLE_M)]
    there = obstacles[obstacles[:, 8] > 0.0]
    if not len(near) or not len(there):
        return False
    # each route point in the frame of each obstacle's box: (K, R)
    x = near[None, :, _X] - there[:, None, _X]
    y = near[None, :, _Y] - there[:, None, _Y]
    cos, sin = np.cos(there[:, None, _YAW]), np.sin(there[:, None, _YAW])
    ahead = np.maximum(np.abs(cos * x + sin * y) - there[:, None, 3] / 2.0, 0.0)
    aside = np.maximum(np.abs(cos * y - sin * x) - there[:, None, 4] / 2.0, 0.0)
    return bool((np.hypot(ahead, aside) < EGO_HALF_WIDTH_M + OBSTACLE_SIDE_M).any())


def stop_line_on(route: NDArray[np.float64], lines: NDArray[np.float64]) -> bool:
    """Whether one of (K, 4+) stop lines, x, y, yaw, …, valid, is the route's own and ahead."""
    near = route[: round(STOP_LINE_M)]
    there = lines[lines[:, -1] > 0.0]
    if not len(near) or not len(there):
        return False
    distance = np.hypot(
        near[None, :, _X] - there[:, None, _X], near[None, :, _Y] - there[:, None, _Y]
    )
    nearest = distance.argmin(axis=1)
    bend = there[:, _YAW] - near[nearest, _YAW]
    along = np.abs(np.arctan2(np.sin(bend), np.cos(bend))) < STOP_LINE_RAD
    close = distance.min(axis=1) < STOP_LINE_SIDE_M
    ahead = there[:, _X] > 0.0
    return bool((close & along & ahead).any())
