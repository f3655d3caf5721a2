"""Training samples rendered from drives: what the policy sees, and what the expert did.

A sample is a moment, and those before it that the memory remembers, 0.5 s apart.
All that varies is drawn from the sample's key: weather, and how far the ego is set aside, with the
expert's true path as the way back.
"""

from __future__ import annotations

import dataclasses
import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from agents.base import Requirements
from agents.driveinsight.agent import requirements_of
from agents.driveinsight.config import TOKENS, PolicyConfig
from agents.driveinsight.inputs import inputs_of
from agents.driveinsight.losses import Targets
from agents.driveinsight.model import Inputs
from agents.training.bev_teacher import bev_semantics
from agents.training.frames import DriveStage, RecordedDrive
from agents.training.told_speeds import told_speeds
from agents.training.variation import Variation, drawn
from agents.training.waypoints import expert_waypoints
from di_envs.numerics.keyed_arrays import keyed_uniforms
from di_envs.numerics.keyed_random import Stream
from di_envs.observer import Observer
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town

Known = NDArray[np.bool_] | None  # (T,) which waypoints can be foreseen; None for all


@dataclass(frozen=True, kw_only=True)
class Sample:
    """What was seen at T moments, oldest first, and the targets of the newest; batches of one.

    Both are bundles of tensors: `Inputs` and `Targets` of the paper's policy, mappings of a system
    of the zoo.
    """

    inputs: tuple[Any, ...]
    targets: Any


class Renderer(ABC):
    """Renders samples of one town with one policy's sensors. Towns are loaded once a process."""

    def __init__(
        self, needs: Requirements, town: Town, plan_of: Callable[[str], RoutePlan]
    ) -> None:
        self._needs, self._town, self._plan_of = needs, town, plan_of
        self._stages = functools.lru_cache(64)(self._stage)

    @abstractmethod
    def inputs(self, observation: Mapping[str, Any], stage: DriveStage) -> Any:
        """What the policy sees at the moment that a stage shows."""

    @abstractmethod
    def targets(
        self,
        drive: RecordedDrive,
        moment: int,
        stage: DriveStage,
        observation: Mapping[str, Any],
        known: Known,
    ) -> Any:
        """What it is to say there, where it can be known."""

    def sample(
        self,
        drive: RecordedDrive,
        last: int,
        variation: Variation,
        key: int,
        *,
        past: int,
        mistold: float = 0.0,
        known: Known = None,
    ) -> Sample:
        """The moments that end at `last`.

        Args:
            drive: In this town.
            last: The newest moment.
            variation: How it is varied.
            key: Of all draws: equal keys give equal samples.
            past: Moments before it, to be remembered; fewer at a drive's start.
            mistold: How probably it is told wrong speeds; see `told_speeds`.
            known: (T,) which waypoints can be foreseen; None for all.
        """
        right_m, turn_rad, weather = drawn(variation, key)
        stage, observer = self._stages(str(drive.facts["route_id"]), drive.capacity)
        observer.change_weather(weather)
        inputs, observation = list[Any](), dict[str, Any]()
        for moment in range(max(last - past, 0), last + 1):
            stage.set(drive, moment, right_m=right_m, turn_rad=turn_rad)
            observation = observer.observe()
            inputs.append(self.inputs(_mistold(observation, mistold, key), stage))
        targets = self.targets(drive, last, stage, observation, known)
        return Sample(inputs=tuple(inputs), targets=targets)

    def _stage(self, route_id: str, capacity: Any) -> tuple[DriveStage, Observer]:
        plan = self._plan_of(route_id)
        sensors = {"cameras": "small", "lidar": "paper", **self._needs.options}
        observer = Observer(self._town, self._needs.observations, **sensors)
        stage = DriveStage(self._town, plan, capacity)
        observer.start(stage.view)  # once: its kernels are looked up in it, which takes a while
        return stage, observer


class PolicyRenderer(Renderer):
    """Renders samples of the paper's policy."""

    def __init__(
        self, config: PolicyConfig, town: Town, plan_of: Callable[[str], RoutePlan]
    ) -> None:
        super().__init__(requirements_of(config), town, plan_of)
        self.config = config

    def inputs(self, observation: Mapping[str, Any], stage: DriveStage) -> Inputs:
        return inputs_of(self.config, observation)

    def targets(
        self,
        drive: RecordedDrive,
        moment: int,
        stage: DriveStage,
        observation: Mapping[str, Any],
        known: Known,
    ) -> Targets:
        state = stage.view.state
        pose = np.array([state.x[0], state.y[0], state.yaw[0]])
        waypoints, valid = expert_waypoints(drive, moment, self.config.planner.waypoints, pose)
        valid *= foreseeable(known, len(valid))
        semantics = None
        if self.config.sensors:
            truth = bev_semantics(stage.view, self.config.grid)
            semantics = torch.from_numpy(truth)[None]
        return Targets(
            waypoints=torch.from_numpy(waypoints)[None],
            valid=torch.from_numpy(valid)[None],
            semantics=semantics,
        )


def _mistold(observation: Mapping[str, Any], share: float, key: int) -> Mapping[str, Any]:
    """What is shown, at times with wrong speeds."""
    if not share:
        return observation
    speeds = {name: observation[name][None] for name in ("speed", "speed_history")}
    told = told_speeds(speeds, share, key)
    return {**observation, **{name: value[0] for name, value in told.items()}}


def foreseeable(known: Known, count: int) -> NDArray[np.float32]:
    """(count,) 1 where a waypoint can be foreseen."""
    if known is None:
        return np.ones(count, np.float32)
    return known[:count].astype(np.float32)


@dataclass(frozen=True, kw_only=True)
class Batch:
    """Samples side by side: T moments of B samples, and where a sample begins.

    Attributes:
        inputs: Of each moment.
        targets: Of the newest.
        begun: (T, B) 0 where the sample has no such moment: it repeats its first.
    """

    inputs: tuple[Any, ...]
    targets: Any
    begun: Tensor


def batch_of(samples: Sequence[Sample]) -> Batch:
    """Puts samples side by side; shorter ones repeat their first moment, which does not count."""
    length = max(len(sample.inputs) for sample in samples)
    inputs, begun = list[Any](), torch.ones(length, len(samples))
    for t in range(length):
        places = [t - (length - len(sample.inputs)) for sample in samples]
        begun[t] = torch.tensor([float(place >= 0) for place in places])
        pairs = zip(samples, places, strict=True)
        inputs.append(joined([sample.inputs[max(place, 0)] for sample, place in pairs]))
    targets = joined([sample.targets for sample in samples])
    return Batch(inputs=tuple(inputs), targets=targets, begun=begun)


def joined(parts: Sequence[Any]) -> Any:
    """Bundles side by side: tensors, mappings or tuples of them, dataclasses of these."""
    first = parts[0]
    if first is None:
        return None
    if isinstance(first, Tensor):
        return torch.cat(list(parts))
    if isinstance(first, Mapping):
        return {name: joined([part[name] for part in parts]) for name in first}
    if isinstance(first, tuple):
        return tuple(joined(group) for group in zip(*parts, strict=True))
    names = [field.name for field in dataclasses.fields(first)]
    return type(first)(**{name: joined([getattr(part, name) for part in parts]) for name in names})


def hidden_components(config: PolicyConfig, batch: int, key: int) -> Tensor:
    """(B, 10) 0 where training hides a component of a sample, by the rates of the config."""
    rates = [config.planner.dropout.get(name, 0.0) for name in TOKENS]
    given = keyed_uniforms(key, int(Stream.AGENT), 0, (batch, len(TOKENS))) >= np.array(rates)
    for group, (names, rate) in enumerate(config.planner.together.items()):
        hidden = keyed_uniforms(key, int(Stream.AGENT), 1 + group, (batch,)) < rate
        for name in names.split("+"):
            given[hidden, TOKENS.index(name)] = False
    return torch.from_numpy(given.astype(np.float32))


def without(names: str, batch: int) -> Tensor:
    """(B, 10) 0 where a component is among names that are joined by '+'; '' is none."""
    hidden = names.split("+")
    return torch.tensor([[float(name not in hidden) for name in TOKENS]]).expand(batch, -1)
