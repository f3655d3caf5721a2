"""The agent `constant`: one control for ever, the simplest agent that there can be."""

from __future__ import annotations

from agents.base import Control, Observation, Requirements, make_control
from di_envs.town.plan import RoutePlan


class ConstantAgent:
    """Holds one control; by default it drives straight ahead on light throttle."""

    requires = Requirements()

    def __init__(self, throttle: float = 0.4, steer: float = 0.0, brake: float = 0.0) -> None:
        for name, value, low in (
            ("throttle", throttle, 0),
            ("steer", steer, -1),
            ("brake", brake, 0),
        ):
            if not low <= value <= 1:
                raise ValueError(f"{name} must lie in [{low}, 1], not {value}")
        self._control = make_control(throttle, steer, brake)

    def start(self, plan: RoutePlan, seed: int) -> None:
        """There is nothing to remember."""

    def act(self, observation: Observation, memory: None) -> tuple[Control, None]:
        """A copy, so that nobody can change the next one."""
        return self._control.copy(), memory

    def close(self) -> None:
        """There is nothing to free."""
