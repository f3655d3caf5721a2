"""The agent `driveinsight`: the policy's waypoints through PID controllers, and nothing else.

Its memory is a value: past BEV features with their poses, and the controllers' past errors.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import torch
from torch import Tensor
from typing_extensions import Self

from agents import AgentSpecError
from agents.base import Control, Observation, Requirements
from agents.driveinsight.config import PolicyConfig
from agents.driveinsight.explained import ExplainedAgent
from agents.driveinsight.inputs import inputs_of
from agents.driveinsight.memory import MemoryBank
from agents.driveinsight.model import Inputs, Output, Policy
from agents.driveinsight.tap_edits import DecisionMoment, EditedDecision, Passed, TapEdit
from agents.driveinsight.weights import WeightsError, from_pretrained
from agents.hub import HubError, local_folder
from agents.networks.fused import fuse_norms
from agents.one_thread import one_thread
from di_envs.actions.controllers import (
    ControllerMemory,
    WaypointControllerConfig,
    waypoints_to_control,
)
from di_envs.edits.text import EditText
from di_envs.town.plan import RoutePlan

SHIPPED = Path(__file__).parent / "weights"  # a folder for each policy, by its name
CONTROL_DT_S = 0.1

Frame = tuple[Tensor, Tensor]  # what is remembered (1, C, X, Y) of a decision, and its pose (1, 3)


@dataclass(frozen=True, kw_only=True)
class DriveInsightMemory:
    """What the policy and its controllers remember.

    Attributes:
        frames: Of the last decisions, newest first, as far back as the memory reaches.
        controllers: Past errors.
        seed: Of the episode: draws of edits inside the policy are keyed by it.
        decision: How many there have been.
        passed: What has passed the edits inside the policy; see `tap_edits`.
    """

    frames: tuple[Frame, ...] = ()
    controllers: ControllerMemory = field(default_factory=ControllerMemory)
    seed: int = 0
    decision: int = 0
    passed: tuple[Passed, ...] = ()


class DriveInsightAgent:
    """Drives with a trained policy.

    Args:
        weights: Folder of a policy, see `weights.save_pretrained`, or `hf:OWNER/REPO`; None for a
            shipped one.
        shipped: Name of that one.

    Raises:
        AgentSpecError: If the folder holds no policy, or this package comes without one.
    """

    def __init__(self, *, weights: str | Path | None = None, shipped: str = "driveinsight") -> None:
        self.policy = _policy(shipped, SHIPPED / shipped if weights is None else weights)
        self.requires = requirements_of(self.policy.config)
        self._controller = WaypointControllerConfig(
            waypoint_dt_s=self.policy.config.planner.waypoint_dt_s
        )
        self._every = round(self.policy.config.memory_dt_s / CONTROL_DT_S)
        self._edits: tuple[TapEdit, ...] = ()

    @property
    def told(self) -> tuple[str, ...]:
        """Components of the prompt that it reads; its controllers read the speed."""
        return tuple(dict.fromkeys((*self.policy.config.prompt, "speed")))

    def edited(self, edits: Sequence[EditText]) -> Self:
        """The same agent with these edits inside its policy; see `tap_edits`.

        Raises:
            EditError: If the policy has no such tap, or an edit cannot be read.
        """
        other = copy.copy(self)
        other._edits = tuple(each for text in edits for each in TapEdit.of(text, self.policy))
        return other

    def start(self, plan: RoutePlan, seed: int) -> DriveInsightMemory:
        """An empty memory: the policy knows the route by its prompt alone."""
        return DriveInsightMemory(seed=seed)

    def act(
        self, observation: Observation, memory: DriveInsightMemory
    ) -> tuple[Control, DriveInsightMemory]:
        """One decision."""
        config = self.policy.config
        with one_thread(), torch.inference_mode():
            inputs, output, passed = self._decide(observation, memory)
        frames = memory.frames
        if output.remembered is not None and inputs.pose is not None:
            reach = config.memory_frames * self._every
            frames = ((output.remembered, inputs.pose), *frames)[:reach]
        control, controllers = waypoints_to_control(
            output.waypoints[0].numpy(),
            float(observation["speed"][0]),
            memory.controllers,
            self._controller,
        )
        return control, DriveInsightMemory(
            frames=frames,
            controllers=controllers,
            seed=memory.seed,
            decision=memory.decision + 1,
            passed=passed,
        )

    def plan(self, observation: Observation, memory: DriveInsightMemory) -> Output:
        """What the policy says where `act` would be asked, as part of torch's graph."""
        return self._decide(observation, memory)[1]

    def explainable(self) -> ExplainedAgent:
        """What `agents.explain` looks at."""
        return ExplainedAgent(self)

    def _decide(
        self, observation: Observation, memory: DriveInsightMemory
    ) -> tuple[Inputs, Output, tuple[Passed, ...]]:
        inputs = self._inputs(observation, memory)
        moment = DecisionMoment(
            seed=memory.seed, decision=memory.decision, time_s=memory.decision * CONTROL_DT_S
        )
        edited = EditedDecision(self._edits, moment, memory.passed)
        with edited.of(self.policy):
            output = self.policy(inputs, self._bank(memory.frames))
        return inputs, output, edited.passed

    def _inputs(self, observation: Observation, memory: DriveInsightMemory) -> Inputs:
        return inputs_of(self.policy.config, observation)

    def _bank(self, frames: tuple[Frame, ...]) -> MemoryBank | None:
        """The frames that are whole multiples of the memory's step old."""
        if not frames:
            return None
        assert self.policy.perception is not None, "who remembers has seen"
        bank = self.policy.perception.empty_bank(1, like=frames[0][0])
        for features, pose in reversed(frames[self._every - 1 :: self._every]):
            bank = bank.remember(features, pose)
        return bank

    def close(self) -> None:
        """There is nothing to free."""


def requirements_of(config: PolicyConfig) -> Requirements:
    """What a policy of that configuration needs from its environment."""
    options: dict[str, object] = {}
    if config.camera is not None:
        options["cameras"] = config.camera.rig
    if config.lidar is not None:
        options["lidar"] = config.lidar.lidar
    return Requirements(
        observations=config.observations, control_dt_s=CONTROL_DT_S, options=options
    )


def _policy(name: str, place: str | Path) -> Policy:
    if place == SHIPPED / name and not (SHIPPED / name).is_dir():
        raise AgentSpecError(
            f"agent '{name}': this version comes without its weights. Train some (docs/training.md "
            f"says how) and name their folder: driveinsight:runs/{name}/policy"
        )
    try:
        policy = from_pretrained(local_folder(place))
    except (WeightsError, HubError) as error:
        raise AgentSpecError(f"agent 'driveinsight': {error}") from error
    fuse_norms(policy)
    return policy
