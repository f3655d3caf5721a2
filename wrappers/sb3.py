"""A Gymnasium vector environment as Stable-Baselines3 takes it, so that training runs in threads.

Stable-Baselines3 has vector environments of its own, from before Gymnasium's. Its `DummyVecEnv`
steps one world after another and its `SubprocVecEnv` copies everything between processes; ours
steps worlds in threads that share one town. This says the one in the words of the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

Indices = None | int | Iterable[int]


class Sb3VecEnv(VecEnv):
    """Wraps a vector environment that was made with `autoreset_mode="SameStep"`.

    An ended episode's `info` holds what the environment's own last `info` does, and, as
    Stable-Baselines3 wants it, `terminal_observation` and `TimeLimit.truncated`. Other steps' are
    empty: a training loop reads none of them.
    """

    def __init__(self, envs: VectorEnv[Any, Any, Any], keys: Sequence[str] | None = None) -> None:
        """Wraps `envs`.

        Args:
            envs: The vector environment; closed with this one.
            keys: Entries of the observation that a policy is to see; None for all.

        Raises:
            ValueError: If `envs` resets at another time than Stable-Baselines3 expects.
            KeyError: If the observation has no such entry.
        """
        mode = envs.metadata.get("autoreset_mode")
        if mode != AutoresetMode.SAME_STEP:
            raise ValueError(
                f"Stable-Baselines3 expects the next episode's first observation in the step that "
                f"ends one: make the environments with autoreset_mode='SameStep', not {mode}."
            )
        self.envs = envs
        space = envs.single_observation_space
        if keys is not None:
            if not isinstance(space, gymnasium.spaces.Dict):
                raise ValueError(f"keys chooses entries of a Dict of observations; got {space}.")
            space = gymnasium.spaces.Dict({key: space[key] for key in keys})
        super().__init__(envs.num_envs, space, envs.single_action_space)
        self._actions: Any = None

    def reset(self) -> VecEnvObs:
        """Starts an episode in every world, with the seeds and options set before."""
        seeds: Any = None if all(seed is None for seed in self._seeds) else self._seeds
        options = self._options[0] if self._options else {}
        if any(other != options for other in self._options):
            raise ValueError("All worlds take the same reset options; set_options got several.")
        observations, _ = self.envs.reset(seed=seeds, options=options or None)
        self._reset_seeds()
        self._reset_options()
        return self._chosen(observations)

    def step_async(self, actions: np.ndarray[Any, Any]) -> None:
        """Takes the actions; `step_wait` steps."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Steps every world."""
        observations, rewards, terminated, truncated, info = self.envs.step(self._actions)
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for index in np.flatnonzero(done).tolist():
            infos[index] = {
                **_row(info["final_info"], index),
                "terminal_observation": self._chosen(info["final_obs"][index]),
                "TimeLimit.truncated": bool(truncated[index] and not terminated[index]),
            }
        return self._chosen(observations), rewards.astype(np.float32), done, infos

    def close(self) -> None:
        """Closes the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """An attribute of the chosen environments; the render mode is one for all."""
        if attr_name == "render_mode":
            return [self.envs.render_mode for _ in self._get_indices(indices)]
        values = self._native().get_attr(attr_name)
        return [values[index] for index in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Sets an attribute of the chosen environments."""
        for index in self._get_indices(indices):
            setattr(self._native().envs[index], attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Calls a method of the chosen environments."""
        envs = self._native().envs
        return [
            getattr(envs[index], method_name)(*method_args, **method_kwargs)
            for index in self._get_indices(indices)
        ]

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]], indices: Indices = None
    ) -> list[bool]:
        """Whether the chosen environments are wrapped, each by itself, in such a wrapper."""
        from stable_baselines3.common.env_util import is_wrapped

        envs = self._native().envs
        return [is_wrapped(envs[index], wrapper_class) for index in self._get_indices(indices)]

    def get_images(self) -> Sequence[np.ndarray[Any, Any] | None]:
        """A frame of each world."""
        frames: Any = self.envs.render()
        return [None] * self.num_envs if frames is None else list(frames)

    def _native(self) -> Any:
        """The vector environment below all vector wrappers."""
        return self.envs.unwrapped

    def _chosen(self, observation: Any) -> Any:
        """The entries of an observation, batched or not, that the space names."""
        if not isinstance(self.observation_space, gymnasium.spaces.Dict):
            return observation
        return {key: observation[key] for key in self.observation_space.spaces}


def _row(batched: Mapping[str, Any], index: int) -> dict[str, Any]:
    """One world's `info` out of a batched one."""
    return {
        key: _row(value, index) if isinstance(value, Mapping) else value[index]
        for key, value in batched.items()
        if not key.startswith("_") and batched.get(f"_{key}", np.ones(index + 1, bool))[index]
    }
