"""Trains a policy on collected drives: plain torch, one function a step, exact to resume.

Which samples make a step, how they are varied and what is hidden in them are functions of (seed,
step), so a run that was killed goes on from its checkpoint as if nothing had been.
"""

from __future__ import annotations

import csv
import dataclasses
import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

from agents.driveinsight.config import PolicyConfig
from agents.driveinsight.losses import LossConfig, losses
from agents.driveinsight.model import Policy
from agents.training.collect import drive_paths
from agents.training.frames import Drive, read_drive
from agents.training.samples import (
    Batch,
    Renderer,
    Sample,
    Variation,
    batch_of,
    hidden_components,
)
from agents.training.towns import load_training_town
from di_envs.keyed_random import Stream, keyed_hash, uniform

CHECKPOINT_FILE = "checkpoint.pt"
LOG_FILE = "log.csv"
STANDING_MPS = 0.1


class TrainingError(Exception):
    """Training cannot begin or go on; the message says why and what to do."""


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """How a policy is trained.

    Attributes:
        steps: Updates of the weights.
        batch: Samples a step; each is a sequence of `memory_frames + 1` moments.
        learning_rate: At its highest, after the warm-up; it falls to 0 along a cosine.
        warm_up: Steps over which it rises.
        weight_decay: AdamW's.
        clip: Largest norm of the gradient.
        seed: Of initial weights and of everything that is drawn.
        standing_share: Of moments at which the ego stands and will stand, this share is taken.
        variation: How samples are varied.
        loss: Weights of the auxiliary terms.
    """

    steps: int = 4000
    batch: int = 16
    learning_rate: float = 1e-3
    warm_up: int = 200
    weight_decay: float = 1e-2
    clip: float = 5.0
    seed: int = 0
    standing_share: float = 0.3
    variation: Variation = field(default_factory=Variation)
    loss: LossConfig = field(default_factory=LossConfig)


@dataclass(frozen=True, kw_only=True)
class Moments:
    """All moments of a folder of drives that training takes samples from."""

    drives: tuple[Drive, ...]
    drive: np.ndarray[Any, Any]  # (M,) index of the drive
    moment: np.ndarray[Any, Any]  # (M,) the newest moment of a sample


def load_moments(folder: Path, standing_share: float, limit: int | None = None) -> Moments:
    """Reads the drives of a folder.

    Args:
        folder: Where `collect` put them.
        standing_share: See `TrainConfig`.
        limit: Take so many moments only: to see that a policy can learn them by heart.

    Raises:
        TrainingError: If there is none.
        DriveFileError: If a file is not whole.
    """
    paths = drive_paths(folder)
    if not paths:
        raise TrainingError(f"there are no drives in {folder}: run `driveinsight collect` first")
    drives = tuple(read_drive(path) for path in paths)
    pairs = []
    for number, drive in enumerate(drives):
        speeds = drive.speeds()
        for moment in range(len(drive) - 1):
            stands = speeds[moment] < STANDING_MPS and speeds[moment + 1] < STANDING_MPS
            draw = float(uniform(number, int(Stream.AGENT), moment, 1))
            if not stands or draw < standing_share:
                pairs.append((number, moment))
    chosen = np.array(pairs[:limit] if limit else pairs)
    return Moments(drives=drives, drive=chosen[:, 0], moment=chosen[:, 1])


class Samples(Dataset[Sample]):
    """Samples by their number over the whole training: step x batch + place in it."""

    def __init__(self, config: PolicyConfig, training: TrainConfig, moments: Moments) -> None:
        self._config, self._training, self._moments = config, training, moments
        self._renderers: dict[str, Renderer] = {}

    def __len__(self) -> int:
        return self._training.steps * self._training.batch

    def __getitem__(self, number: int) -> Sample:
        key = int(keyed_hash(self._training.seed, int(Stream.AGENT), number, 2)) % 2**62
        row = key % len(self._moments.drive)
        drive = self._moments.drives[self._moments.drive[row]]
        renderer = self._renderer(str(drive.facts["town"]))
        moment = int(self._moments.moment[row])
        return renderer.sample(drive, moment, self._training.variation, key)

    def _renderer(self, town: str) -> Renderer:
        if town not in self._renderers:
            loaded, plans = load_training_town(town)
            self._renderers[town] = Renderer(self._config, loaded, plans)
        return self._renderers[town]


def batches(samples: Samples, training: TrainConfig, first: int, workers: int) -> Iterator[Batch]:
    """Batches from a step on, rendered by other processes ahead of time, or here for 0 workers."""
    torch.multiprocessing.set_sharing_strategy("file_system")
    numbers = range(first * training.batch, len(samples))
    loader = DataLoader(
        samples,
        batch_size=training.batch,
        sampler=numbers,
        collate_fn=batch_of,
        num_workers=workers,
        multiprocessing_context="spawn" if workers else None,
        prefetch_factor=4 if workers else None,
    )
    yield from loader


@dataclass(kw_only=True)
class Training:
    """A policy being trained: all that a checkpoint holds."""

    policy: Policy
    optimiser: torch.optim.Optimizer
    config: TrainConfig
    step: int = 0

    @classmethod
    def begin(cls, policy_config: PolicyConfig, config: TrainConfig, device: str) -> Training:
        """Fresh weights, drawn from the seed."""
        torch.manual_seed(config.seed)
        policy = Policy(policy_config).to(device)
        optimiser = torch.optim.AdamW(
            policy.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        return cls(policy=policy, optimiser=optimiser, config=config)

    def save(self, path: Path) -> None:
        """Writes a checkpoint; the old one stays until the new one is whole."""
        part = path.with_suffix(".part")
        torch.save(
            {
                "policy_config": self.policy.config.to_mapping(),
                "config": dataclasses.asdict(self.config),
                "policy": self.policy.state_dict(),
                "optimiser": self.optimiser.state_dict(),
                "step": self.step,
            },
            part,
        )
        os.replace(part, path)

    def load(self, path: Path) -> None:
        """Goes on from a checkpoint.

        Raises:
            TrainingError: If it is not whole, or of another policy or training.
        """
        try:
            content = torch.load(path, weights_only=True)
        except Exception as error:
            raise TrainingError(
                f"{path} is not whole ({error}): delete it to begin again"
            ) from error
        ours = (self.policy.config.to_mapping(), dataclasses.asdict(self.config))
        if (content["policy_config"], content["config"]) != ours:
            raise TrainingError(
                f"{path} is of another configuration: give the same options, or another --output"
            )
        self.policy.load_state_dict(content["policy"])
        self.optimiser.load_state_dict(content["optimiser"])
        self.step = content["step"]

    def update(self, batch: Batch) -> dict[str, float]:
        """One step on a batch; returns the terms of the loss.

        Raises:
            TrainingError: If the loss is not finite: the weights are left as they were.
        """
        for group in self.optimiser.param_groups:
            group["lr"] = self._learning_rate()
        self.policy.train()
        self.optimiser.zero_grad()
        total: dict[str, float] = {}
        for terms in self._terms(batch):
            if not torch.isfinite(terms["total"]):
                raise TrainingError(
                    f"the loss is {float(terms['total'].detach())} at step {self.step}: try a "
                    f"lower --learning-rate; the last checkpoint is whole"
                )
            (terms["total"] / len(batch.inputs)).backward()
            for name, value in terms.items():
                total[name] = total.get(name, 0.0) + float(value.detach()) / len(batch.inputs)
        torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.config.clip)
        self.optimiser.step()
        self.step += 1
        return total

    def _learning_rate(self) -> float:
        config = self.config
        if self.step < config.warm_up:
            return config.learning_rate * (self.step + 1) / config.warm_up
        done = (self.step - config.warm_up) / max(config.steps - config.warm_up, 1)
        return config.learning_rate * 0.5 * (1.0 + math.cos(math.pi * min(done, 1.0)))

    def _terms(self, batch: Batch) -> Iterator[dict[str, Tensor]]:
        """The loss of each moment; later ones remember earlier ones, without their gradients."""
        policy, device = self.policy, next(self.policy.parameters()).device
        size = len(batch.targets[0].waypoints)
        key = int(keyed_hash(self.config.seed, int(Stream.AGENT), self.step, 3)) % 2**62
        hidden = hidden_components(policy.config, size, key).to(device)
        bank = None
        for t, (inputs, targets) in enumerate(zip(batch.inputs, batch.targets, strict=True)):
            inputs, targets = _to(inputs, device), _to(targets, device)
            seen = dataclasses.replace(inputs, present=inputs.present * hidden)
            with torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda"):
                output = policy(seen, bank)
            yield losses(output, targets, self.config.loss)
            if policy.memory is not None and output.bev is not None and inputs.pose is not None:
                bank = bank or policy.empty_bank(size, like=output.bev)
                bank = bank.remember(output.bev.detach(), inputs.pose)
                begun = batch.begun[t].bool().to(device)
                valid = torch.cat([bank.valid[:, :1] & begun[:, None], bank.valid[:, 1:]], dim=1)
                bank = dataclasses.replace(bank, valid=valid)


def _to(values: Any, device: torch.device) -> Any:
    """A bundle of tensors on a device."""

    def moved(value: Any) -> Any:
        if isinstance(value, Tensor):
            return value.to(device, non_blocking=True)
        return {name: moved(item) for name, item in value.items()} if value else value

    fields = dataclasses.fields(values)
    return type(values)(**{field.name: moved(getattr(values, field.name)) for field in fields})


def train(
    training: Training,
    data: Iterator[Batch],
    folder: Path,
    *,
    on_step: Callable[[int, dict[str, float]], None],
    checkpoint_every_s: float = 120.0,
    log_every: int = 20,
) -> None:
    """Trains to the last step; writes checkpoints and a log on the way.

    Args:
        training: Fresh, or loaded from a checkpoint.
        data: Batches from `training.step` on.
        folder: For the checkpoint and the log.
        on_step: Told each step's number and loss terms.
        checkpoint_every_s: Wall-clock time between checkpoints.
        log_every: Steps whose mean makes a row of the log.
    """
    saved_s, sums, count = time.monotonic(), dict[str, float](), 0
    for batch in data:
        terms = training.update(batch)
        on_step(training.step, terms)
        for name, value in terms.items():
            sums[name] = sums.get(name, 0.0) + value
        count += 1
        if training.step % log_every == 0:
            _log(folder / LOG_FILE, training.step, {n: s / count for n, s in sums.items()})
            sums, count = {}, 0
        if time.monotonic() - saved_s > checkpoint_every_s:
            training.save(folder / CHECKPOINT_FILE)
            saved_s = time.monotonic()
        if training.step >= training.config.steps:
            break
    training.save(folder / CHECKPOINT_FILE)


def _log(path: Path, step: int, terms: dict[str, float]) -> None:
    """Appends a row. After a resume some steps come again: the last row of a step counts."""
    fresh = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if fresh:
            writer.writerow(["step", *terms])
        writer.writerow([step, *(f"{value:.5f}" for value in terms.values())])
