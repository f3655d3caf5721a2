"""The stage in which the eyes learn to see, alone: sequences of drives, supervised by the truth.

Which sequences make a step, and how they are varied, are functions of (seed, step): a run that was
killed goes on from its checkpoint as if nothing had been. Each moment is encoded once, and what it
is remembered by learns from all that remember it.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from agents.driveinsight.heads import Heads
from agents.driveinsight.memory import bank_of_sequence
from agents.driveinsight.model import Policy
from agents.driveinsight.perception import Perception
from agents.driveinsight.perception_losses import (
    PerceptionTargets,
    perception_losses,
)
from agents.driveinsight.weights import save_pretrained
from agents.training.board import BOARD_FOLDER, Tell, board
from agents.training.checkpoints import load_checkpoint, rate_at, save_checkpoint
from agents.training.config import TrainingError
from agents.training.loading import rendered
from agents.training.log import append_row, forget_rows_after
from agents.training.loop import (
    CHECKPOINT_EVERY_S,
    CHECKPOINT_FILE,
    LOG_EVERY,
    LOG_FILE,
    POLICY_FOLDER,
)
from agents.training.moments import load_moments
from agents.training.perceive_config import PerceiveConfig
from agents.training.perceive_samples import Sequences, order
from agents.training.perception_metrics import figures, perception_sums
from agents.training.predictions import on_device
from agents.training.sequences import Moments, joined
from di_envs.files.json_values import to_json


def look(perception: Perception, moments: Moments, length: int) -> tuple[Heads, tuple[Tensor, ...]]:
    """What is said of sequences, and the depth logits; each moment is encoded once.

    Args:
        perception: The eyes.
        moments: B sequences, of `length` moments each.
        length: T.
    """
    encoded = perception.encode(moments.images, moments.points)
    bank = None
    if encoded.remembered is not None:
        bank = bank_of_sequence(
            encoded.remembered.unflatten(0, (-1, length)),
            moments.poses.unflatten(0, (-1, length)),
            perception.config.memory_frames,
        )
    bev = perception.fuse(encoded, moments.poses, bank)
    return perception.say(bev, encoded), encoded.depth


@dataclass(kw_only=True)
class Perceiving:
    """Eyes being trained: all that a checkpoint holds.

    Attributes:
        policy: Whose perception learns; the rest of it stays as it is.
        optimiser: Of the perception.
        config: How.
        data: Digest of the drives.
        step: Updates so far.
    """

    policy: Policy
    optimiser: torch.optim.Optimizer
    config: PerceiveConfig
    data: str
    step: int = 0

    @classmethod
    def begin(cls, policy: Policy, config: PerceiveConfig, data: str) -> Perceiving:
        """At the first step.

        Raises:
            TrainingError: If the policy has no sensors.
        """
        if policy.perception is None:
            raise TrainingError(f"'{policy.config.name}' has no sensors: there is nothing to learn")
        optimiser = torch.optim.AdamW(
            policy.perception.parameters(),
            lr=config.learning_rate,
            weight_decay=config.weight_decay,
        )
        return cls(policy=policy, optimiser=optimiser, config=config, data=data)

    @property
    def perception(self) -> Perception:
        """The eyes."""
        assert self.policy.perception is not None
        return self.policy.perception

    def save(self, path: Path) -> None:
        """Writes a checkpoint; the old one stays until the new one is whole."""
        save_checkpoint(path, self._asked(), self.policy, self.optimiser, self.step)

    def load(self, path: Path) -> None:
        """Goes on from a checkpoint.

        Raises:
            TrainingError: If it is not whole, or of another policy or training.
        """
        asked, defaults = self._asked(), to_json(PerceiveConfig())
        self.step = load_checkpoint(path, asked, self.policy, self.optimiser, defaults=defaults)

    def update(self, moments: Moments) -> dict[str, float]:
        """One step; returns the terms of the loss.

        Raises:
            TrainingError: If the loss is not finite: the weights are left as they were.
        """
        config = self.config
        rate = rate_at(
            self.step,
            highest=config.learning_rate,
            warm_up=config.warm_up,
            steps=config.steps,
        )
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.perception.train()
        self.optimiser.zero_grad()
        heads, depth, targets = self._look(moments)
        terms = perception_losses(heads, depth, targets, self.policy.config.grid, config.weights)
        terms["total"].backward()
        norm = torch.nn.utils.clip_grad_norm_(self.perception.parameters(), config.clip)
        if not torch.isfinite(norm):
            raise TrainingError(
                f"the gradient's norm is {float(norm)} at step {self.step}: try a lower "
                f"learning_rate in another folder; the last checkpoint is whole"
            )
        self.optimiser.step()
        self.step += 1
        return {name: float(value.detach()) for name, value in terms.items()}

    def measure(self, data: Iterator[Moments]) -> dict[str, float | None]:
        """Figures on drives kept out, at moments that remember all that they can."""
        self.perception.eval()
        sums, length = Counter[str](), self.config.length
        full = min(self.policy.config.memory_frames, length - 1)
        with torch.no_grad():
            for _ in range(self.config.measured_sequences // self.config.batch):
                heads, _, targets = self._look(next(data))
                chosen = torch.arange(len(targets.signal)) % length >= full
                heads, targets = moments_of(heads, chosen), moments_of(targets, chosen)
                sums.update(perception_sums(heads, targets, self.policy.config.grid))
        return figures(sums)

    def _look(self, moments: Moments) -> tuple[Heads, tuple[Tensor, ...], PerceptionTargets]:
        device = self._device()
        moments = on_device(moments, device)
        mixed = self.config.precision == "bfloat16"
        with torch.autocast(device.type, torch.bfloat16, enabled=mixed):
            heads, depth = look(self.perception, moments, self.config.length)
        return heads, depth, moments.targets

    def _device(self) -> torch.device:
        return next(self.perception.parameters()).device

    def _asked(self) -> dict[str, Any]:
        """What decides what comes out."""
        asked = {**to_json(self.config), "data": self.data}
        return {**asked, "policy": self.policy.config.to_mapping()}


def perceive(
    policy: Policy,
    config: PerceiveConfig,
    data: Sequence[Path],
    folder: Path,
    *,
    workers: int = 1,
    tell: Callable[[int, Mapping[str, float]], None] = lambda step, terms: None,
    stop: Callable[[], bool] = lambda: False,
) -> bool:
    """Trains a policy's perception to the last step, or goes on; writes it into `folder`/policy.

    Args:
        policy: On the device to train on, with the weights to begin with.
        config: How.
        data: Folders of drives.
        folder: For all that is written: a checkpoint, log.csv, and in the end the policy.
        workers: Processes that render ahead of time.
        tell: Told each step's number and loss terms.
        stop: Asked after each step whether to stop; a checkpoint is written then.

    Returns:
        Whether the last step was done.

    Raises:
        TrainingError: If there is nothing to learn from, or the folder holds another training.
        DriveFileError: If a drive is not whole.
    """
    chosen = load_moments(data, config.standing_share)
    training = Perceiving.begin(policy, config, chosen.digest)
    folder.mkdir(parents=True, exist_ok=True)
    checkpoint = folder / CHECKPOINT_FILE
    if checkpoint.exists():
        training.load(checkpoint)
    forget_rows_after(folder / LOG_FILE, training.step)
    sequences = Sequences(policy.config, config, chosen)
    numbers = order(config, training.step)
    batches = rendered(sequences, config.batch, numbers, joined, workers=workers)
    watched = board(folder / BOARD_FOLDER, first_step=training.step + 1)
    with closing(batches), watched as told:
        _learn(training, batches, folder, tell, stop, told)
    training.save(checkpoint)
    if training.step < config.steps:
        return False
    card = f"Eyes of '{policy.config.name}' after {training.step} steps; no driver yet.\n"
    save_pretrained(policy, folder / POLICY_FOLDER, card)
    return True


def _learn(
    training: Perceiving,
    batches: Iterator[Moments],
    folder: Path,
    tell: Callable[[int, Mapping[str, float]], None],
    stop: Callable[[], bool],
    told: Tell,
) -> None:
    """Steps until the last one, or until it is asked to stop; writes the log and checkpoints."""
    config = training.config
    saved_s, sums, count = time.monotonic(), Counter[str](), 0
    while training.step < config.steps and not stop():
        terms = training.update(next(batches))
        tell(training.step, terms)
        sums.update(terms)
        count += 1
        measured = config.measured_after(training.step)
        if training.step % LOG_EVERY and not measured:
            continue
        found = training.measure(batches) if measured else dict.fromkeys(figures({}))
        row = {name: value / count for name, value in sums.items()}
        whole = {"step": training.step, **row, **found}
        append_row(folder / LOG_FILE, whole)
        told(whole)
        sums, count = Counter[str](), 0
        # together with a row, so that rows are the same however often a run is cut
        if time.monotonic() - saved_s > CHECKPOINT_EVERY_S:
            training.save(folder / CHECKPOINT_FILE)
            saved_s = time.monotonic()


def moments_of(values: Any, chosen: Tensor) -> Any:
    """Some moments of a bundle of tensors."""

    def cut(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(cut(item) for item in value)
        return None if value is None else value[chosen.to(value.device)]

    return replace(values, **{name: cut(value) for name, value in vars(values).items()})
