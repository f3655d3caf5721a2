"""The agent `human`: a person, who sees the world in a window and drives by what is pressed there.

Who drives sees the streets from above, and so more than is visible from the car: the track is
PRIVILEGED. What a person decides cannot be asked for again, so such a drive is replayed by its
controls alone.
"""

from __future__ import annotations

from collections.abc import Callable

from agents.base import Control, Observation, Requirements, make_control
from agents.human.hands import control_of_keys, control_of_pad
from di_envs.drawing.screen import Screen
from di_envs.town.plan import RoutePlan

BY = ("keyboard", "gamepad")


class PlayerLeftError(Exception):
    """The person who drives gave up: closed the window, or pressed Ctrl-C."""


class HumanAgent:
    """Shows the world, waits for as long as a decision takes, and returns what is held then."""

    requires = Requirements(observations=("inertial",), privileged=True, branchable=False)

    def __init__(
        self,
        by: str = "keyboard",
        screen: Screen | None = None,
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        """Takes the seat.

        Args:
            by: What is held, one of `BY`.
            screen: With a window, in which the keys are pressed.
            stopped: Whether they were told otherwise to stop.

        Raises:
            ValueError: If it is driven by neither.
        """
        if by not in BY:
            raise ValueError(f"a person drives by one of {', '.join(BY)}; got '{by}'")
        self._by, self._screen, self._stopped = by, screen, stopped

    def start(self, plan: RoutePlan, seed: int) -> Control:
        """No pedal, no wheel.

        Raises:
            RuntimeError: If there is no window: nobody can be asked.
        """
        if self._screen is None:
            raise RuntimeError(
                "a person drives in the window of `driveinsight play`, and cannot be asked again "
                "what they did: `driveinsight watch` replays it"
            )
        return make_control(0.0, 0.0, 0.0)

    def act(self, observation: Observation, memory: Control) -> tuple[Control, Control]:
        """What is held after the person has seen the present moment.

        Raises:
            PlayerLeftError: If the window is closed, or Ctrl-C was pressed.
        """
        assert self._screen is not None
        assert self._screen.window is not None
        view, window = observation["world"], self._screen.window
        self._screen.draw(view, view.ego, {})
        if window.closed or self._stopped():
            raise PlayerLeftError("the drive was given up before the route was over")
        pad = window.pad() if self._by == "gamepad" else None
        if pad is not None:
            control = control_of_pad(*pad)
        else:
            speed_mps = float(observation["speed"][0])
            control = control_of_keys(window.held, memory, speed_mps, self.requires.control_dt_s)
        return control, control

    def close(self) -> None:
        """The window is not the agent's."""
