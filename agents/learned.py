"""Policies that learned elsewhere as agents: what they see by a preset, what they do as a control.

A function from an observation to an action is all that learning libraries have in common, and all
that `LearnedAgent` asks for. `agents.sb3` turns the actions of its models into controls here, too.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.base import Control, Observation, Requirements, make_control
from agents.one_thread import one_thread
from di_envs.actions.controllers import (
    ControllerMemory,
    WaypointControllerConfig,
    waypoints_to_control,
)
from di_envs.actions.forms import FORMS, pedal_to_control
from di_envs.files.names import check_name
from di_envs.observation import observation_space
from di_envs.presets import Form
from di_envs.town.plan import RoutePlan
from di_envs.world.kinds import TICK_S

Policy = Callable[[Any], Any]
_CONTROLLER = WaypointControllerConfig()


class LearnedAgent:
    """Drives by a policy that was trained on an environment with a preset.

    The policy has no memory of its own. What it is of, a network, say, must be picklable:
    `leaderboard.evaluate` and `agents.pickled.keep_agent` take the agent by value.
    """

    def __init__(
        self,
        policy: Policy,
        *,
        preset: str = "flat",
        observations: tuple[str, ...] = ("prompt",),
        control_dt_s: float = 0.1,
        action: str = "pedal",
        **sensors: Any,
    ) -> None:
        """Says what it requires, with the preset: both are kept with what it scores.

        Args:
            policy: From one observation in the preset's form to one action.
            preset: With which it was trained.
            observations: Groups that it was trained with.
            control_dt_s: For how long an action is held.
            action: Which form its actions have, one of `di_envs.actions.forms.FORMS`; what is out
                of range is clipped.
            sensors: `cameras` and `lidar`, as `RouteEnv` takes them.

        Raises:
            ValueError: If one of these is unknown, or cannot be together.
        """
        check_name(action, FORMS, "form of action")
        self._policy, self._action = policy, action
        half_sweeps = control_dt_s == TICK_S
        space = observation_space(observations, half_sweeps=half_sweeps, **sensors)
        self._form = Form(space, preset)
        self.requires = Requirements(
            observations=observations, control_dt_s=control_dt_s, options=sensors, preset=preset
        )

    def start(self, plan: RoutePlan, seed: int) -> ControllerMemory:
        """The memory of the waypoints' controller; with other actions it stays empty."""
        return ControllerMemory()

    def act(
        self, observation: Observation, memory: ControllerMemory
    ) -> tuple[Control, ControllerMemory]:
        """The control that the policy's action stands for."""
        with one_thread():
            action = np.asarray(self._policy(self._form.of(observation)), np.float32)
        space = FORMS[self._action]
        action = np.clip(action.reshape(space.shape), space.low, space.high)
        return control_of(action, self._action, observation, memory)

    def close(self) -> None:
        """There is nothing to free."""


def control_of(
    action: NDArray[np.float32], form: str, observation: Observation, memory: ControllerMemory
) -> tuple[Control, ControllerMemory]:
    """The control that an action stands for.

    Args:
        action: In the range of its form.
        form: One of `FORMS`.
        observation: Holds the `speed` [m/s], where the form is `waypoints`.
        memory: Of the controller that follows waypoints, before and after.
    """
    if form == "waypoints":
        speed_mps = float(observation["speed"][0])
        return waypoints_to_control(action, speed_mps, memory, _CONTROLLER)
    control = pedal_to_control(action) if form == "pedal" else action
    return make_control(*control.tolist()), memory
