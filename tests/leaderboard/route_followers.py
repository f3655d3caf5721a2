"""Tiny agents that drive along what the prompt says of the route, for tests of what it is told."""

from __future__ import annotations

import numpy as np

from agents.base import Requirements, make_control
from di_envs.actions.controllers import (
    ControllerMemory,
    WaypointControllerConfig,
    waypoints_to_control,
)
from di_envs.prompt import COMPONENTS

_CONFIG = WaypointControllerConfig()
_METRES_APART = 3  # of waypoints 0.5 s apart: about 6 m/s


class RouteFollower:
    """Follows `routing` at 6 m/s while it is given, else brakes; ignores everybody."""

    requires = Requirements(observations=("prompt",))

    def start(self, plan, seed):
        return ControllerMemory()

    def act(self, observation, memory):
        routing = observation["routing"]
        if not observation["prompt_present"][COMPONENTS.index("routing")] or not routing[0, 3]:
            return make_control(0.0, 0.0, 1.0), memory
        points = routing[_METRES_APART - 1 : 8 * _METRES_APART : _METRES_APART, :2]
        speed_mps = float(observation["speed"][0])
        return waypoints_to_control(np.asarray(points), speed_mps, memory, _CONFIG)

    def close(self):
        pass
