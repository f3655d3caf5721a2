"""`sb3:path.zip`: a model of Stable-Baselines3 at the wheel, scored like any other agent.

What the model was trained with is read off its spaces: the groups of observations, the rig, the
preset (`di_envs.presets`), and whether tables were made vectors (`wrappers.vectors`) or all was
laid in one (`FlattenObservation`); throttle, steer and brake, one pedal, or waypoints
(`wrappers.actions`). What spaces do not tell, how long an action is held, the model says itself
where it was given `model.driveinsight_options = {"control_dt_s": 0.2}` before `save`, or its user
in `sb3:path.zip?control_dt_s=0.2`. What a recurrent model remembers is in the agent's memory.

It decides alone (a batch of one) on one thread of torch, since other batches and threads give
other bits; the action is the policy's most likely one, not a draw.
"""

from __future__ import annotations

import importlib
import json
import pickle
import warnings
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from agents import AgentSpecError
from agents.base import Control, Observation, Requirements
from agents.learned import control_of
from agents.one_thread import one_thread
from agents.sb3.one_vector import Senses
from agents.sb3.spaces import senses_of
from di_envs.actions.controllers import ControllerMemory
from di_envs.actions.forms import form_of, rescaled
from di_envs.config import check_name
from di_envs.town.plan import RoutePlan

# An algorithm, and a setting that only its files have; tried in this order, as A2C's is PPO's too.
ALGORITHMS = {
    "PPO": "clip_range",
    "SAC": "target_entropy",
    "TD3": "target_policy_noise",  # and DDPG, which is a TD3 with other settings
    "DQN": "exploration_fraction",
    "A2C": "gae_lambda",
}
# Those of sb3-contrib, by where their policies are
CONTRIB = {
    "sb3_contrib.common.recurrent": "RecurrentPPO",
    "sb3_contrib.tqc": "TQC",
    "sb3_contrib.crossq": "CrossQ",
}
_WITH_BUFFER = ("SAC", "TD3", "DQN", "TQC", "CrossQ")
OPTIONS = ("control_dt_s", "cameras", "lidar", "preset")  # what a model may say of itself


@dataclass(frozen=True, kw_only=True)
class Sb3Memory:
    """What an episode leaves behind: of the waypoints' controller, and of a recurrent model."""

    controller: ControllerMemory = field(default_factory=ControllerMemory)
    state: Any = None  # arrays that the model gives and takes; None where it has none, or at first


class Sb3Agent:
    """Drives with a model that Stable-Baselines3 saved.

    Loading a model runs code that its file holds: load only those that you trust.
    """

    def __init__(self, path: str, **options: Any) -> None:
        """Loads the model.

        Args:
            path: The zip file that `model.save` wrote.
            options: `control_dt_s`, `cameras`, `lidar`, `preset`: what it was trained with, where
                neither its spaces nor the model itself say so.

        Raises:
            AgentSpecError: If Stable-Baselines3 is not installed, the file is no model, or its
                spaces are not what an environment of ours offers.
        """
        self._name = f"sb3:{path}"
        data = _read_data(self._name, Path(path))
        self._model = _load(self._name, Path(path), _algorithm_of(self._name, data))
        told = {**getattr(self._model, "driveinsight_options", {}), **options}
        try:
            for option in told:
                check_name(option, OPTIONS, "option of a model")
            told["control_dt_s"] = float(told.get("control_dt_s", 0.1))
            self._senses: Senses = senses_of(self._model.observation_space, told)
            self._space = self._model.action_space
            self._form = form_of(self._space)
            self.requires = Requirements(
                observations=self._senses.groups,
                control_dt_s=told["control_dt_s"],
                options=self._senses.options,
                preset=self._senses.preset,
            )
        except ValueError as error:
            raise AgentSpecError(f"agent '{self._name}': {error}") from error
        if self._form == "waypoints" and not {"prompt", "inertial"} & set(self._senses.groups):
            raise AgentSpecError(
                f"agent '{self._name}' gives waypoints, and the controller that follows them needs "
                f"the speed: train it with the observation group 'prompt' or 'inertial'."
            )

    @property
    def network(self) -> Any:
        """The model's policy, a `torch.nn.Module`."""
        return self._model.policy

    def start(self, plan: RoutePlan, seed: int) -> Sb3Memory:
        """Nothing is remembered yet."""
        return Sb3Memory()

    def act(self, observation: Observation, memory: Sb3Memory) -> tuple[Control, Sb3Memory]:
        """The control that the policy's most likely action stands for."""
        seen = self._senses.see(observation)
        with one_thread():
            action, state = self._model.predict(seen, state=memory.state, deterministic=True)
        action = rescaled(action, self._space, self._form)
        control, controller = control_of(action, self._form, observation, memory.controller)
        return control, Sb3Memory(controller=controller, state=state)

    def close(self) -> None:
        """There is nothing to free."""


def _read_data(name: str, path: Path) -> Mapping[str, Any]:
    """The settings that a model's file holds, as JSON; nothing in it is run."""
    if not path.is_file():
        raise AgentSpecError(f"agent '{name}': there is no file {path.absolute()}.")
    try:
        with zipfile.ZipFile(path) as archive:
            data = json.loads(archive.read("data"))
    except (zipfile.BadZipFile, KeyError, ValueError, RecursionError) as error:
        raise AgentSpecError(
            f"agent '{name}': expected a zip file that a Stable-Baselines3 model was saved in "
            f"(model.save), got something else: {error}."
        ) from error
    if not isinstance(data, dict):
        raise AgentSpecError(f"agent '{name}': its settings are no JSON object.")
    return data


def _algorithm_of(name: str, data: Mapping[str, Any]) -> str:
    policy = data.get("policy_class", {})
    module = policy.get("__module__", "") if isinstance(policy, dict) else ""
    found = [algorithm for place, algorithm in CONTRIB.items() if module.startswith(place)]
    if not module.startswith("sb3_contrib"):
        found = [algorithm for algorithm, mark in ALGORITHMS.items() if mark in data]
    if not found or "cg_max_steps" in data:  # TRPO, whose policy is of no module of its own
        raise AgentSpecError(
            f"agent '{name}': it is no model of a supported algorithm "
            f"({', '.join(ALGORITHMS)}, DDPG, {', '.join(CONTRIB.values())}); its policy is from "
            f"'{module or 'nowhere'}'."
        )
    return found[0]


def _load(name: str, path: Path, algorithm: str) -> Any:
    place = "sb3_contrib" if algorithm in CONTRIB.values() else "stable_baselines3"
    try:
        library = importlib.import_module(place)
    except ImportError as error:
        raise AgentSpecError(
            f"agent '{name}' needs {place}: pip install 'driveinsight[rl]' ({error})."
        ) from error
    try:
        with warnings.catch_warnings():
            # what cannot be read is only warned of, and missed much later
            warnings.simplefilter("error", UserWarning)
            # a buffer of experience is of no use here, and may be as large as the memory
            small = {"buffer_size": 1, "n_envs": 1}
            kept = small if algorithm in _WITH_BUFFER else {}
            return getattr(library, algorithm).load(path, device="cpu", custom_objects=kept)
    except (
        ValueError, KeyError, RuntimeError, TypeError, AttributeError, ImportError, UserWarning,
        pickle.UnpicklingError,
    ) as error:  # fmt: skip
        raise AgentSpecError(
            f"agent '{name}': this {algorithm} model cannot be loaded; was it saved with other "
            f"versions, or does it need code that is not here? {type(error).__name__}: {error}"
        ) from error


__all__ = ["ALGORITHMS", "CONTRIB", "OPTIONS", "Sb3Agent"]
