"""The agents `llm:MODULE:FUNCTION`: a function is told the prompt as text, and answers in JSON.

The function may ask a language model, or be one of rules; it is code of others, so it drives in a
process of its own. It is called at every decision and waited for, while the world stands still. A
score repeats only as far as its answers do.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import AgentSpecError, module_of
from agents.base import Control, Observation, Requirements, make_control
from agents.llm.answers import FORMS, Follow, Stop, Waypoints, read_answer
from di_envs.actions.controllers import (
    ControllerMemory,
    WaypointControllerConfig,
    waypoints_to_control,
)
from di_envs.drawing.told_picture import told_picture
from di_envs.drawing.told_text import rows_of, told_text
from di_envs.town.plan import RoutePlan

TASK = (
    "You drive a car in a town. Follow the route, keep to the right of way, stop before red and "
    "yellow lights and at stop signs, and hit nobody."
)
BRAKING_MPS2 = 3.0  # of the manoeuvre `stop`
_TIMES_S = 0.5 * np.arange(1, 9)
_PICTURE = ("off", "on")


class LanguageModelAgent:
    """Asks a function at every decision, and turns what it answers into a control."""

    def __init__(self, function: str, picture: str = "off", control_dt_s: str = "0.1") -> None:
        """Finds the function.

        Args:
            function: `module:function` or `path/to/file.py:function`. It is given text, and with
                `picture` a (640, 640, 3) uint8 RGB array, and returns an answer (`answers`).
            picture: Whether it is given the picture too: `on` or `off`.
            control_dt_s: How often it is asked, in seconds of the world.

        Raises:
            AgentSpecError: If there is no such function, or an option is wrong.
        """
        spec = f"llm:{function}"
        place, _, name = function.rpartition(":")
        if not place:
            raise AgentSpecError(f"agent '{spec}': expected llm:MODULE:FUNCTION")
        if picture not in _PICTURE:
            raise AgentSpecError(f"agent '{spec}': picture is on or off; got '{picture}'")
        found = getattr(module_of(spec, place), name, None)
        if not callable(found):
            raise AgentSpecError(f"agent '{spec}': {place} has no function '{name}'")
        self._function: Callable[..., Any] = found
        self._with_picture = picture == "on"
        self._config = WaypointControllerConfig()
        try:
            self.requires = Requirements(control_dt_s=float(control_dt_s))
        except ValueError as error:
            raise AgentSpecError(f"agent '{spec}': {error}") from error

    def start(self, plan: RoutePlan, seed: int) -> ControllerMemory:
        """The controllers' errors; what the function remembers is its own affair."""
        return ControllerMemory()

    def act(
        self, observation: Observation, memory: ControllerMemory
    ) -> tuple[Control, ControllerMemory]:
        """Asks, reads and steers.

        Raises:
            AnswerError: If what came is no answer.
        """
        told = [f"{TASK}\n{told_text(observation)}\n{FORMS}"]
        shown = [told_picture(observation)] if self._with_picture else []
        answer = read_answer(self._function(*told, *shown))
        speed_mps = float(observation["speed"][0])
        if isinstance(answer, Waypoints):
            places = answer.places
        else:
            ahead_m = _metres_ahead(answer, speed_mps)
            route = _route(observation)
            if len(route) < 2:
                return make_control(0.0, 0.0, 1.0), memory
            places = _along(route, ahead_m)
        return waypoints_to_control(places, speed_mps, memory, self._config)

    def close(self) -> None:
        """There is nothing to free."""


def _metres_ahead(answer: Follow | Stop, speed_mps: float) -> NDArray[np.float64]:
    """How far along the route the ego is to be at each waypoint's time."""
    if isinstance(answer, Follow):
        return np.asarray(answer.speed_mps * _TIMES_S)
    braked_s = np.minimum(_TIMES_S, max(speed_mps, 0.0) / BRAKING_MPS2)
    return np.asarray(max(speed_mps, 0.0) * braked_s - 0.5 * BRAKING_MPS2 * braked_s**2)


def _route(observation: Observation) -> NDArray[np.float64]:
    """(P, 2) the ego, then the route's points."""
    points = rows_of(observation["routing"])[:, :2].astype(np.float64)
    return np.concatenate([np.zeros((1, 2)), points])


def _along(route: NDArray[np.float64], ahead_m: NDArray[np.float64]) -> NDArray[np.float32]:
    """(T, 2) places on the route after so many metres; its end is gone past straight on."""
    last = route[-1] - route[-2]
    beyond = route[-1] + last / max(float(np.hypot(*last)), 1e-6) * 100.0
    path = np.concatenate([route, beyond[None]])
    station = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    return np.stack([np.interp(ahead_m, station, path[:, axis]) for axis in (0, 1)], axis=1).astype(
        np.float32
    )
