"""An agent of your own in one file: follows the route, keeps its distance, stops at red lights.

Score it beside the others:

    driveinsight evaluate --agent examples/your_own_agent.py:RouteFollower --suite town05_tiny

It sees the structured prompt only. Stop signs, walkers about to cross and right of way are left to
you. Run as a script, `python examples/your_own_agent.py`, it drives one route.
"""

from __future__ import annotations

import numpy as np

from agents.base import Control, Observation, Requirements
from di_envs.actions.controllers import (
    ControllerMemory,
    WaypointControllerConfig,
    waypoints_to_control,
)
from di_envs.town.lanes import LightState
from di_envs.town.plan import RoutePlan

CRUISE_MPS = 8.0
BRAKING_MPS2 = 2.5  # comfortable: what it plans with
NOSE_M = 2.5  # from the ego's centre to its bumper
GAP_M = 3.0  # kept to what stands ahead
PATH_HALF_WIDTH_M = 1.8  # what comes nearer to the route than this is in the way


class RouteFollower:
    """Turns the route ahead into waypoints, and those into a control by two PID controllers."""

    # What the environment must give: these observations, a decision each 0.1 s, no true state.
    requires = Requirements(observations=("prompt",), control_dt_s=0.1)

    def __init__(self) -> None:
        self._config = WaypointControllerConfig()

    def start(self, plan: RoutePlan, seed: int) -> ControllerMemory:
        """Memory is a value, so that an episode can be branched with its agent."""
        return ControllerMemory()

    def act(
        self, observation: Observation, memory: ControllerMemory
    ) -> tuple[Control, ControllerMemory]:
        """Where to be in 0.5, 1, 1.5 and 2 s, and the control that leads there."""
        path = route_ahead(observation)
        if len(path) < 2:
            return np.array([0.0, 0.0, 1.0], np.float32), memory  # the route is over: brake
        speed = min(CRUISE_MPS, speed_before(free_metres(observation, path)))
        waypoints = points_along(path, speed * np.array([0.5, 1.0, 1.5, 2.0]))
        return waypoints_to_control(waypoints, float(observation["speed"][0]), memory, self._config)

    def close(self) -> None:
        """There is nothing to free."""


def route_ahead(observation: Observation) -> np.ndarray:
    """(P, 2) the ego, then the next route points, about 1 m apart: x ahead, y right [m]."""
    routing = observation["routing"].astype(float)
    routing = routing[routing[:, 3] > 0]  # the last column says what is valid
    path = np.concatenate([np.zeros((1, 2)), routing[:, :2]])
    if 0 < len(routing) < len(observation["routing"]):  # near its end: go on straight, past it
        x, y, yaw, _ = routing[-1]
        metres = np.arange(1.0, 21.0)
        beyond = np.stack([x + metres * np.cos(yaw), y + metres * np.sin(yaw)], axis=1)
        path = np.concatenate([path, beyond])
    return path


def free_metres(observation: Observation, path: np.ndarray) -> float:
    """How far the ego may go before somebody in its way, or a light that is not green."""
    free = np.inf
    for x, y, _, length, *_, valid in observation["obstacles"]:
        if valid:
            free = min(free, metres_to(path, x, y) - NOSE_M - length / 2 - GAP_M)
    for x, y, yaw, state, valid in observation["traffic_lights"]:
        # the stop line must be on the path, and face the way the path goes there
        if valid and state in (LightState.YELLOW, LightState.RED) and abs(yaw) < 0.8:
            free = min(free, metres_to(path, x, y) - NOSE_M)
    return free


def metres_to(path: np.ndarray, x: float, y: float) -> float:
    """Metres along the path to where it passes a place; infinite where it does not."""
    distance = np.hypot(path[1:, 0] - x, path[1:, 1] - y)
    return float(np.argmin(distance)) if distance.min() < PATH_HALF_WIDTH_M else np.inf


def speed_before(free_m: float) -> float:
    """The speed from which the ego still stops within `free_m`."""
    return float(np.sqrt(2.0 * BRAKING_MPS2 * max(free_m, 0.0)))


def points_along(path: np.ndarray, metres: np.ndarray) -> np.ndarray:
    """(T, 2) places on the path after so many metres."""
    steps = np.hypot(*np.diff(path, axis=0).T)
    station = np.concatenate([[0.0], np.cumsum(steps)])
    return np.stack([np.interp(metres, station, path[:, axis]) for axis in (0, 1)], axis=1)


def main() -> None:
    """Drives one route of `town05_tiny`."""
    from di_envs import RouteEnv

    agent = RouteFollower()
    env = RouteEnv(suite="town05_tiny", observations=agent.requires.observations)
    observation, info = env.reset(seed=0, options={"route": 0})
    memory = agent.start(env.plan, 0)
    over = False
    while not over:
        action, memory = agent.act(observation, memory)
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated
    print(f"route {info['route_id']} ended by: {info['finished']}")
    print(f"driving score {info['driving_score']:.1f} after {info['game_time_s']:.1f} s")


if __name__ == "__main__":
    main()
