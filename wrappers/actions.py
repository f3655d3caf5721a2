"""Other forms of action for a policy: one pedal, or waypoints that a controller follows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv
from gymnasium.wrappers.vector import TransformAction
from numpy.typing import NDArray

from di_envs.actions.controllers import (
    ControllerMemory,
    WaypointControllerConfig,
    waypoints_to_control,
)
from di_envs.actions.forms import WAYPOINT_DT_S, pedal_space, pedal_to_control, waypoint_space
from di_envs.prompt import SPEED_LIMIT_MPS

Observation = Mapping[str, Any]
Action = NDArray[np.float32]


class PedalWrapper(gymnasium.ActionWrapper[Observation, Action, Action]):
    """One pedal and the wheel: `Box(-1, 1, (2,))`, pedal (brake to throttle) and steer.

    Symmetric and normalised, which is what Stable-Baselines3 asks of an action space.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self.action_space: Any = pedal_space()

    def action(self, action: Action) -> Action:
        """Throttle, steer and brake; see `pedal_to_control`."""
        return pedal_to_control(action)


def pedal_vector(envs: VectorEnv[Any, Any, Any]) -> TransformAction:
    """What `PedalWrapper` is for one environment, for a vector of them."""
    return TransformAction(envs, pedal_to_control, single_action_space=pedal_space())


class WaypointWrapper(gymnasium.ActionWrapper[Observation, Action, Action]):
    """Takes where the ego should be in 0.5 s, 1 s, … 4 s, and steers it there by two PIDs.

    The action is (8, 2): x ahead, y right [m], in the ego's frame of the moment. The controllers
    (`di_envs.actions.controllers`) look at the first two points. Their past errors and the speed
    that they last saw are what `di_envs.save` keeps of this wrapper.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], config: WaypointControllerConfig | None = None
    ) -> None:
        """Wraps an environment whose observation holds the `speed`, in metres a second.

        Args:
            env: An environment with the observation group `prompt` or `inertial`.
            config: The controllers' gains and limits; None takes the policy's own.

        Raises:
            ValueError: If there is no such speed, or the points' spacing is not 0.5 s.
        """
        super().__init__(env)
        space = env.observation_space
        speed = space.get("speed") if isinstance(space, gymnasium.spaces.Dict) else None
        if not isinstance(speed, gymnasium.spaces.Box) or speed.high.max() != SPEED_LIMIT_MPS:
            raise ValueError(
                "WaypointWrapper reads the ego's speed from the observation: make the environment "
                "with the group 'prompt' or 'inertial', and put wrappers that rescale the speed "
                "outside of this one."
            )
        self.action_space: Any = waypoint_space()
        self._config = config or WaypointControllerConfig()
        if self._config.waypoint_dt_s != WAYPOINT_DT_S:
            raise ValueError(
                f"Waypoints are {WAYPOINT_DT_S} s apart; got {self._config.waypoint_dt_s} s."
            )
        self._memory, self._speed_mps = ControllerMemory(), 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode, with no errors to remember."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._memory, self._speed_mps = ControllerMemory(), float(observation["speed"][0])
        return observation, info

    def step(self, action: Action) -> tuple[Observation, Any, bool, bool, dict[str, Any]]:
        """Holds the control that leads along the waypoints."""
        result = super().step(action)
        self._speed_mps = float(result[0]["speed"][0])
        return result

    def action(self, action: Action) -> Action:
        """Throttle, steer and brake; moves the controller on by one call."""
        control, self._memory = waypoints_to_control(
            action, self._speed_mps, self._memory, self._config
        )
        return control

    def save_state(self) -> tuple[ControllerMemory, float]:
        """The controller's past errors, and the speed that it will be given next."""
        return self._memory, self._speed_mps

    def restore_state(self, value: tuple[ControllerMemory, float]) -> None:
        """Puts back what `save_state` returned."""
        self._memory, self._speed_mps = value
