"""The agent that drives with any system of the zoo; what is a system's own is said by its class.

Its memory is a value: what the network remembers, the controllers' past errors, and what rules
remember.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from typing_extensions import Self

from agents import AGENTS, AgentSpecError
from agents.base import Control, Observation, make_control
from agents.driveinsight.tap_edits import DecisionMoment, EditedDecision, Passed, TapEdit
from agents.explain.protocol import Anatomy
from agents.hub import HubError, local_folder
from agents.networks.fused import fuse_norms
from agents.networks.weights import WeightsError
from agents.one_thread import one_thread
from agents.zoo.controls import FOLLOWING, PidT
from agents.zoo.inputs import inputs_of
from agents.zoo.registry import recipe_of
from agents.zoo.system import CONTROL_DT_S, MOMENT_DT_S, Output, State, SystemModel
from agents.zoo.weights import load_system
from di_envs.actions.controllers import ControllerMemory, waypoints_to_control
from di_envs.edits.text import EditText
from di_envs.files.names import check_name
from di_envs.town.plan import RoutePlan

_EVERY = round(MOMENT_DT_S / CONTROL_DT_S)  # decisions between two moments of a network's memory


@dataclass(frozen=True, kw_only=True)
class SystemMemory:
    """What a system, its controllers and its rules remember.

    Attributes:
        states: What the network remembered at the last decisions, newest first.
        controllers: Past errors.
        rules: Of the hand-written rules of a system that has some.
        seed: Of the episode: draws of edits inside the network are keyed by it.
        decision: How many there have been.
        passed: What has passed the edits inside the network; see `tap_edits`.
    """

    states: tuple[State, ...] = ()
    controllers: ControllerMemory = field(default_factory=ControllerMemory)
    rules: Any = None
    seed: int = 0
    decision: int = 0
    passed: tuple[Passed, ...] = ()


class SystemAgent:
    """Drives with a trained system.

    Args:
        weights: Folder of a system that `driveinsight train` wrote, or `hf:OWNER/REPO`; None for
            the shipped one.
        shipped: Name of that one in the table of agents.
        rules: `on` drives with the controller and rules that were published with it, `off` with the
            controller that all policies of this project share, and nothing else.

    Raises:
        AgentSpecError: If the folder holds no system, or none is shipped yet.
    """

    # The published controller; None of a system that came without one, or without rules
    published: ClassVar[PidT | None] = None

    def __init__(
        self, *, shipped: str, weights: str | Path | None = None, rules: str = "on"
    ) -> None:
        try:
            check_name(rules, ("on", "off"), "value of rules")
        except ValueError as error:
            raise AgentSpecError(f"agent '{shipped}': {error}") from error
        self.network = _network(shipped, _shipped(shipped) if weights is None else weights)
        self.requires = self.network.config.requires
        self.rules = rules == "on"
        self._edits: tuple[TapEdit, ...] = ()

    @property
    def told(self) -> tuple[str, ...]:
        """Components of the prompt that it reads; its controllers read the speed."""
        return tuple(dict.fromkeys((*self.network.config.told, "speed")))

    def edited(self, edits: Sequence[EditText]) -> Self:
        """The same agent with these edits inside its network; see `tap_edits`.

        Raises:
            EditError: If the network has no such tap, or an edit cannot be read.
        """
        other = copy.copy(self)
        other._edits = tuple(each for text in edits for each in TapEdit.of(text, self.network))
        return other

    def start(self, plan: RoutePlan, seed: int) -> SystemMemory:
        """An empty memory: a system knows the route by what it is told alone."""
        return SystemMemory(seed=seed)

    def act(self, observation: Observation, memory: SystemMemory) -> tuple[Control, SystemMemory]:
        """One decision."""
        with one_thread(), torch.inference_mode():
            edited = self._edited(memory)
            output = self.decide(observation, memory, edited)
        control, controllers, rules = self.control(output, observation, memory)
        states = ((output.state, *memory.states)[:_EVERY]) if output.state else ()
        return control, SystemMemory(
            states=states,
            controllers=controllers,
            rules=rules,
            seed=memory.seed,
            decision=memory.decision + 1,
            passed=edited.passed,
        )

    def decide(
        self, observation: Observation, memory: SystemMemory, edited: EditedDecision | None = None
    ) -> Output:
        """What the network says, as part of torch's graph.

        Args:
            observation: What the agent sees.
            memory: What it remembers.
            edited: Who makes the edits inside the network, for those who go on from there.
        """
        state = memory.states[_EVERY - 1] if len(memory.states) == _EVERY else None
        if state is not None and not torch.is_inference_mode_enabled():
            state = tuple(part.clone() for part in state)  # as gradients go through it
        with (edited or self._edited(memory)).of(self.network):
            output: Output = self.network(self.seen(observation, memory), state)
        return output

    def _edited(self, memory: SystemMemory) -> EditedDecision:
        moment = DecisionMoment(
            seed=memory.seed, decision=memory.decision, time_s=memory.decision * CONTROL_DT_S
        )
        return EditedDecision(self._edits, moment, memory.passed)

    def seen(self, observation: Observation, memory: SystemMemory) -> dict[str, Tensor]:
        """What the network is shown: everything, unless a system shuts its eyes."""
        return inputs_of(self.network.config, observation)

    def control(
        self, output: Output, observation: Observation, memory: SystemMemory
    ) -> tuple[Control, ControllerMemory, Any]:
        """From what the network said to pedals, and what controllers and rules remember.

        A system with rules of its own overrides this, and heeds `self.rules`.
        """
        if output.action is not None:
            return action_to_control(output.action), memory.controllers, None
        waypoints, speed_mps = output.waypoints[0].numpy(), float(observation["speed"][0])
        if self.rules and self.published is not None:
            control, errors = self.published.control(waypoints, speed_mps, memory.controllers)
            return control, errors, None
        control, errors = waypoints_to_control(waypoints, speed_mps, memory.controllers, FOLLOWING)
        return control, errors, None

    def explainable(self) -> ExplainedSystem:
        """What `agents.explain` looks at."""
        return ExplainedSystem(self)

    def close(self) -> None:
        """There is nothing to free."""


class ExplainedSystem:
    """The network of an agent, with the edits that the agent makes inside it."""

    def __init__(self, agent: SystemAgent) -> None:
        self._agent = agent

    @property
    def model(self) -> nn.Module:
        """The network."""
        return self._agent.network

    @property
    def anatomy(self) -> Anatomy:
        """Its parts."""
        return self._agent.network.anatomy

    def waypoints(self, observation: Observation, memory: Any) -> Tensor:
        """(T, 2) of a decision."""
        return self._agent.decide(observation, memory).waypoints[0]


def action_to_control(action: Tensor) -> Control:
    """The pedals of (1, 2) throttle less brake, and steer."""
    pedal, steer = action[0].tolist()
    return make_control(max(pedal, 0.0), steer, max(-pedal, 0.0))


def _shipped(name: str) -> Path:
    """Where the weights of a shipped system are, or will be."""
    folder = Path(__file__).parents[1] / AGENTS[name].data
    if not folder.is_dir():
        raise AgentSpecError(
            f"agent '{name}': not trained yet: driveinsight train --recipe {recipe_of(name)}"
        )
    return folder


def _network(name: str, place: str | Path) -> SystemModel:
    try:
        network = load_system(local_folder(place))
    except (WeightsError, HubError) as error:
        raise AgentSpecError(f"agent '{name}': {error}") from error
    fuse_norms(network)
    return network
