"""What the training loop must know of what it trains: the paper's policy, and the zoo's systems.

Which moments make a batch, how they are varied, checkpoints, logs and checks are the same for all;
what differs is here, behind one contract.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from agents.base import Requirements
from agents.driveinsight.agent import SHIPPED, requirements_of
from agents.driveinsight.config import BEV, CONFIGS, TOKENS, PolicyConfig
from agents.driveinsight.losses import Targets, counts, losses
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import from_pretrained, save_pretrained
from agents.networks.weights import take_tensors
from agents.training.config import TrainConfig
from agents.training.frames import DriveStage, RecordedDrive
from agents.training.labels import labels_of
from agents.training.model_card import about_policy, about_system
from agents.training.predictions import look, on_device
from agents.training.samples import (
    Batch,
    Known,
    PolicyRenderer,
    Renderer,
    hidden_components,
    without,
)
from agents.training.standing import FOR
from agents.zoo.eyes import BevEyes
from agents.zoo.inputs import inputs_of
from agents.zoo.registry import config_from, config_of, network_of, system_names, system_of
from agents.zoo.system import Output, SystemConfig, SystemModel
from agents.zoo.weights import holds_system, load_network, save_system
from di_envs.config import check_name
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town

Config = PolicyConfig | SystemConfig
Terms = tuple[dict[str, Tensor], dict[str, Tensor]]  # of a loss, and what each is a mean over
_PLANNING = ("prompt.", "planner.")  # what a policy that sees nothing has too


class Trainee(ABC):
    """What is trained.

    Attributes:
        config: Of it.
        scheme: How it is driven once it is on disk: `SCHEME:FOLDER`.
    """

    config: Config
    scheme: str

    @property
    @abstractmethod
    def past(self) -> int:
        """Moments before the newest of a sample."""

    @property
    @abstractmethod
    def requires(self) -> Requirements:
        """What it needs from its environment."""

    @property
    def convolves(self) -> bool:
        """Whether most of its time goes into convolutions, as with pictures."""
        return "camera" in self.requires.observations

    @property
    def pretrained(self) -> Path | None:
        """A policy whose cameras it sees by before it has learnt anything; None for fresh ones."""
        return None

    @abstractmethod
    def network(self) -> nn.Module:
        """What training begins with: weights drawn from torch's generator, but for `pretrained`."""

    @abstractmethod
    def renderer(self, town: Town, plan_of: Callable[[str], RoutePlan]) -> Renderer:
        """What renders its samples in a town."""

    @abstractmethod
    def learnt(
        self, network: nn.Module, batch: Batch, training: TrainConfig, key: int, share: slice
    ) -> Terms:
        """The loss of a step.

        Args:
            network: That learns.
            batch: Of a share of the step's samples.
            training: The whole of it.
            key: Of all that is drawn in the step.
            share: Which samples these are.
        """

    @abstractmethod
    def measured(
        self, network: nn.Module, batch: Batch, training: TrainConfig, hidden: str
    ) -> Terms:
        """The loss on moments kept out, without the components that `hidden` names."""

    @abstractmethod
    def groups(self, network: nn.Module, training: TrainConfig) -> list[dict[str, Any]]:
        """Its parameters for the optimiser, with a `rate` each."""

    @abstractmethod
    def about(self, network: nn.Module) -> tuple[str, ...]:
        """Paragraphs of its card, the title first."""

    @abstractmethod
    def save(self, network: nn.Module, folder: Path, card: str) -> None:
        """Writes it with its card."""

    def take(
        self, network: nn.Module, folder: Path, *, only: str = ""
    ) -> tuple[list[str], list[str]]:
        """Takes over tensors of what a folder holds, whose names begin so; see `take_tensors`."""
        other = load_network(folder)
        state = other.state_dict()
        theirs = {name: value for name, value in state.items() if name.startswith(only)}
        return take_tensors(network, theirs, folder)


@dataclasses.dataclass(frozen=True)
class PaperTrainee(Trainee):
    """The paper's policy."""

    config: PolicyConfig
    scheme = "driveinsight"

    @property
    def past(self) -> int:
        return self.config.memory_frames

    @property
    def requires(self) -> Requirements:
        return requirements_of(self.config)

    def network(self) -> Policy:
        return Policy(self.config)

    def renderer(self, town: Town, plan_of: Callable[[str], RoutePlan]) -> Renderer:
        return PolicyRenderer(self.config, town, plan_of)

    def learnt(
        self, network: nn.Module, batch: Batch, training: TrainConfig, key: int, share: slice
    ) -> Terms:
        size = training.batch
        given = torch.ones(size, len(TOKENS))
        if not training.overfit:
            given = hidden_components(self.config, size, key)
        learnt = dataclasses.replace(batch, targets=self._known(batch.targets, given[share]))
        return self._terms(network, learnt, training, given[share])

    def _known(self, targets: Targets, given: Tensor) -> Targets:
        """Without those who stand for what is hidden here; see `standing`."""
        if targets.stands_for is None:
            return targets
        told = given * torch.tensor([float(name in self._has) for name in TOKENS])
        columns = [TOKENS.index(name) for name in FOR]
        hidden = (targets.stands_for * (1.0 - told[:, columns])).amax(dim=1)
        unknown = hidden * (1.0 - told[:, TOKENS.index(BEV)])
        return dataclasses.replace(targets, valid=targets.valid * (1.0 - unknown)[:, None])

    @property
    def _has(self) -> tuple[str, ...]:
        """What it is told, and whether it sees."""
        sees = self.config.camera is not None or self.config.lidar is not None
        return (*self.config.prompt, *([BEV] if sees else []))

    def measured(
        self, network: nn.Module, batch: Batch, training: TrainConfig, hidden: str
    ) -> Terms:
        return self._terms(network, batch, training, without(hidden, batch.begun.shape[1]))

    def _terms(
        self, network: nn.Module, batch: Batch, training: TrainConfig, given: Tensor
    ) -> Terms:
        assert isinstance(network, Policy)
        mixed = training.precision == "bfloat16"
        output, targets = look(network, batch, given, mixed=mixed)
        return losses(output, targets, training.loss), counts(targets, training.loss)

    def groups(self, network: nn.Module, training: TrainConfig) -> list[dict[str, Any]]:
        """Those that see, and those that plan; where nothing is rendered the first stay."""
        seeing, planning = list[nn.Parameter](), list[nn.Parameter]()
        for name, parameter in network.named_parameters():
            (planning if name.startswith(_PLANNING) else seeing).append(parameter)
        found = ((seeing if training.rendered else [], 1.0), (planning, training.planner_rate))
        return [{"params": params, "rate": rate} for params, rate in found if params]

    def about(self, network: nn.Module) -> tuple[str, ...]:
        return about_policy(network, self.config)

    def save(self, network: nn.Module, folder: Path, card: str) -> None:
        assert isinstance(network, Policy)
        save_pretrained(network, folder, card)


@dataclasses.dataclass(frozen=True)
class SystemTrainee(Trainee):
    """A system of the zoo."""

    config: SystemConfig
    scheme = "zoo"

    @property
    def past(self) -> int:
        return self.config.past

    @property
    def requires(self) -> Requirements:
        return self.config.requires

    @property
    def pretrained(self) -> Path | None:
        name = system_of(self.config.system).eyes
        return SHIPPED / name if name else None

    def network(self) -> SystemModel:
        network = network_of(self.config)
        if self.pretrained is not None:
            policy = from_pretrained(self.pretrained)
            for part in network.modules():
                if isinstance(part, BevEyes):
                    part.learnt_by(policy)
        return network

    def renderer(self, town: Town, plan_of: Callable[[str], RoutePlan]) -> Renderer:
        return SystemRenderer(self.config, town, plan_of)

    def learnt(
        self, network: nn.Module, batch: Batch, training: TrainConfig, key: int, share: slice
    ) -> Terms:
        torch.manual_seed(key + share.start)  # of dropout and of what a system draws: by the step
        return self._terms(network, batch, training)

    def measured(
        self, network: nn.Module, batch: Batch, training: TrainConfig, hidden: str
    ) -> Terms:
        return self._terms(network, batch, training)

    def _terms(self, network: nn.Module, batch: Batch, training: TrainConfig) -> Terms:
        """Moment after the other, with gradients through what is remembered.

        Samples that begin at their drive's start repeat its first moment, as if the car had stood.
        """
        assert isinstance(network, SystemModel)
        device = next(network.parameters()).device
        mixed = training.precision == "bfloat16"
        output: Output | None = None
        with torch.autocast(device.type, torch.bfloat16, enabled=mixed):
            for moment in batch.inputs:
                output = network(on_device(moment, device), output.state if output else None)
            assert output is not None, "a batch has a moment"
            terms = network.loss(output, on_device(batch.targets, device))  # some have layers
        size = torch.tensor(float(len(output.waypoints)), device=device)
        total = torch.stack([term.float() for term in terms.values()]).sum()
        return {**terms, "total": total}, dict.fromkeys(terms, size)

    def groups(self, network: nn.Module, training: TrainConfig) -> list[dict[str, Any]]:
        """All that learns; what is frozen, such as a teacher, does not."""
        return [{"params": [p for p in network.parameters() if p.requires_grad], "rate": 1.0}]

    def about(self, network: nn.Module) -> tuple[str, ...]:
        return about_system(network, self.config)

    def save(self, network: nn.Module, folder: Path, card: str) -> None:
        assert isinstance(network, SystemModel)
        save_system(network, folder, card)


class SystemRenderer(Renderer):
    """Renders samples of a system of the zoo."""

    def __init__(
        self, config: SystemConfig, town: Town, plan_of: Callable[[str], RoutePlan]
    ) -> None:
        super().__init__(config.requires, town, plan_of)
        self._config = config

    def inputs(self, observation: Mapping[str, Any], stage: DriveStage) -> Mapping[str, Tensor]:
        return inputs_of(self._config, {**observation, "world": stage.view})

    def targets(
        self,
        drive: RecordedDrive,
        moment: int,
        stage: DriveStage,
        observation: Mapping[str, Any],
        known: Known,
    ) -> Mapping[str, Tensor]:
        return labels_of(self._config, drive, moment, stage, observation, known)


def trainee_of(config: Config) -> Trainee:
    """The contract of a configuration."""
    return PaperTrainee(config) if isinstance(config, PolicyConfig) else SystemTrainee(config)


def trainee_from(values: Mapping[str, Any]) -> Trainee:
    """That of a configuration's JSON values."""
    if "system" in values:
        return trainee_of(config_from(values, "configuration of a system"))
    return trainee_of(PolicyConfig.from_mapping(values))


def config_named(name: str) -> Config:
    """A configuration of the paper's policy, or of a system of the zoo.

    Raises:
        ValueError: If there is none of that name; suggests the nearest.
    """
    check_name(name, (*CONFIGS, *system_names()), "policy configuration")
    return CONFIGS[name] if name in CONFIGS else config_of(name)


def driver_of(folder: Path) -> str:
    """How a policy on disk is named as an agent."""
    return f"{'zoo' if holds_system(folder) else 'driveinsight'}:{folder}"
