"""Training samples rendered from drives: what the policy sees, and what the expert did.

A sample is a moment, and those before it that the memory remembers, 0.5 s apart.
All that varies is drawn from the sample's key: weather, and how far the ego is set aside, with the
expert's true path as the way back.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from agents.driveinsight.config import TOKENS, PolicyConfig
from agents.driveinsight.inputs import inputs_of
from agents.driveinsight.losses import Targets
from agents.driveinsight.model import Inputs
from agents.training.bev_teacher import bev_semantics
from agents.training.frames import DriveStage, RecordedDrive
from agents.training.variation import Variation, drawn
from agents.training.waypoints import expert_waypoints
from di_envs.numerics.keyed_arrays import keyed_uniforms
from di_envs.numerics.keyed_random import Stream
from di_envs.observer import Observer
from di_envs.sensors.camera.config import rig_of
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town


@dataclass(frozen=True, kw_only=True)
class Sample:
    """What was seen at T moments, oldest first, and the targets of the newest; batches of one."""

    inputs: tuple[Inputs, ...]
    targets: Targets


class Renderer:
    """Renders samples of one town with one policy's sensors. Towns are loaded once a process."""

    def __init__(
        self, config: PolicyConfig, town: Town, plan_of: Callable[[str], RoutePlan]
    ) -> None:
        self.config, self._town, self._plan_of = config, town, plan_of
        self._rig = None if config.camera is None else rig_of(config.camera.rig)
        self._stages = functools.lru_cache(64)(self._stage)

    def sample(
        self, drive: RecordedDrive, last: int, variation: Variation, key: int, *, past: int
    ) -> Sample:
        """The moments that end at `last`.

        Args:
            drive: In this town.
            last: The newest moment.
            variation: How it is varied.
            key: Of all draws: equal keys give equal samples.
            past: Moments before it, to be remembered; fewer at a drive's start.
        """
        right_m, turn_rad, weather = drawn(variation, key)
        stage, observer = self._stages(str(drive.facts["route_id"]), drive.capacity)
        observer.change_weather(weather)
        inputs = []
        for moment in range(max(last - past, 0), last + 1):
            stage.set(drive, moment, right_m=right_m, turn_rad=turn_rad)
            observation = observer.observe()
            inputs.append(inputs_of(self.config, observation))
        return Sample(inputs=tuple(inputs), targets=self._targets(drive, last, stage))

    def _stage(self, route_id: str, capacity: Any) -> tuple[DriveStage, Observer]:
        plan = self._plan_of(route_id)
        lidar = self.config.lidar.lidar if self.config.lidar else "paper"
        observer = Observer(
            self._town,
            self.config.observations,
            cameras=self._rig or "small",
            lidar=lidar,
        )
        stage = DriveStage(self._town, plan, capacity)
        observer.start(stage.view)  # once: its kernels are looked up in it, which takes a while
        return stage, observer

    def _targets(self, drive: RecordedDrive, moment: int, stage: DriveStage) -> Targets:
        state = stage.view.state
        pose = np.array([state.x[0], state.y[0], state.yaw[0]])
        waypoints, valid = expert_waypoints(drive, moment, self.config.planner.waypoints, pose)
        semantics = None
        if self.config.sensors:
            truth = bev_semantics(stage.view, self.config.grid)
            semantics = torch.from_numpy(truth)[None]
        return Targets(
            waypoints=torch.from_numpy(waypoints)[None],
            valid=torch.from_numpy(valid)[None],
            semantics=semantics,
        )


@dataclass(frozen=True, kw_only=True)
class Batch:
    """Samples side by side: T moments of B samples, and where a sample begins.

    Attributes:
        inputs: Of each moment.
        targets: Of the newest.
        begun: (T, B) 0 where the sample has no such moment: it repeats its first.
    """

    inputs: tuple[Inputs, ...]
    targets: Targets
    begun: Tensor


def batch_of(samples: Sequence[Sample]) -> Batch:
    """Puts samples side by side; shorter ones repeat their first moment, which does not count."""
    length = max(len(sample.inputs) for sample in samples)
    inputs, begun = [], torch.ones(length, len(samples))
    for t in range(length):
        places = [t - (length - len(sample.inputs)) for sample in samples]
        begun[t] = torch.tensor([float(place >= 0) for place in places])
        pairs = zip(samples, places, strict=True)
        inputs.append(_joined_inputs([sample.inputs[max(place, 0)] for sample, place in pairs]))
    targets = _joined_targets([sample.targets for sample in samples])
    return Batch(inputs=tuple(inputs), targets=targets, begun=begun)


def _joined(parts: Sequence[Tensor | None]) -> Tensor | None:
    kept = [part for part in parts if part is not None]
    return torch.cat(kept) if kept else None


def _joined_inputs(parts: Sequence[Inputs]) -> Inputs:
    return Inputs(
        prompt={name: torch.cat([part.prompt[name] for part in parts]) for name in parts[0].prompt},
        present=torch.cat([part.present for part in parts]),
        images=tuple(torch.cat(group) for group in zip(*(p.images for p in parts), strict=True)),
        points=_joined([part.points for part in parts]),
        pose=_joined([part.pose for part in parts]),
    )


def _joined_targets(parts: Sequence[Targets]) -> Targets:
    return Targets(
        waypoints=torch.cat([part.waypoints for part in parts]),
        valid=torch.cat([part.valid for part in parts]),
        semantics=_joined([part.semantics for part in parts]),
    )


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
