"""The stage in which the eyes learn to see, alone: sequences of drives, supervised by the truth.

Which sequences make a step, and how they are varied, are functions of (seed, step): a run that was
killed goes on from its checkpoint as if nothing had been. Each moment is encoded once, and what it
is remembered by learns from all that remember it.
"""

from __future__ import annotations

import math
import pickle
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.utils.data import Dataset

from agents.driveinsight.config import PolicyConfig
from agents.driveinsight.heads import Heads
from agents.driveinsight.memory import bank_of_sequence
from agents.driveinsight.model import Policy
from agents.driveinsight.perception import Perception
from agents.driveinsight.perception_losses import (
    PerceptionTargets,
    PerceptionWeights,
    perception_losses,
)
from agents.driveinsight.weights import save_pretrained
from agents.training.config import TrainingError
from agents.training.frames import RecordedDrive, read_drive
from agents.training.loading import Moments as Chosen
from agents.training.loading import load_moments, rendered, town_of
from agents.training.log import append_row, forget_rows_after
from agents.training.loop import (
    CHECKPOINT_EVERY_S,
    CHECKPOINT_FILE,
    LOG_EVERY,
    LOG_FILE,
    POLICY_FOLDER,
)
from agents.training.perception_metrics import figures, perception_sums
from agents.training.predictions import on_device
from agents.training.sequences import Moments, SequenceRenderer, joined
from agents.training.variation import Variation
from di_envs.differences import differences
from di_envs.files.json_values import to_json
from di_envs.files.whole import write_whole
from di_envs.numerics.keyed_random import Stream, keyed_hash


@dataclass(frozen=True, kw_only=True)
class PerceiveConfig:
    """How eyes are trained.

    Attributes:
        steps: Updates of the weights.
        batch: Sequences a step.
        length: Moments of a sequence, 0.5 s apart; each is supervised.
        learning_rate: At its highest, after the warm-up; it falls to 0 along a cosine.
        warm_up: Steps over which it rises.
        weight_decay: AdamW's.
        clip: Largest norm of the gradient.
        seed: Of initial weights and of everything that is drawn.
        standing_share: Of moments at which the ego stands and will stand, this share is taken.
        precision: `float32`, or `bfloat16` for products and convolutions (mixed precision).
        held_out: Share of the drives that is kept out of training, to measure by.
        measured: Sequences of these that are looked at …
        measured_every: … after so many steps.
        variation: How sequences are varied.
        weights: Of the terms of the loss.
    """

    steps: int = 4000
    batch: int = 5
    length: int = 4
    learning_rate: float = 2e-3
    warm_up: int = 200
    weight_decay: float = 1e-2
    clip: float = 5.0
    seed: int = 0
    standing_share: float = 0.2
    precision: str = "float32"
    held_out: float = 0.05
    measured: int = 100
    measured_every: int = 500
    variation: Variation = field(default_factory=Variation)
    weights: PerceptionWeights = field(default_factory=PerceptionWeights)

    def __post_init__(self) -> None:
        for name in ("steps", "batch", "length", "measured_every"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")

    def measured_after(self, step: int) -> bool:
        """Whether the eyes are measured on drives kept out after so many steps."""
        return self.held_out > 0.0 and (step % self.measured_every == 0 or step == self.steps)


class Sequences(Dataset[Moments]):
    """Sequences by their number over the whole training: step x batch + place in it.

    Numbers beyond the training's are those that it is measured on: unvaried but for weather, and
    the same each time.
    """

    def __init__(self, policy: PolicyConfig, training: PerceiveConfig, chosen: Chosen) -> None:
        self._policy, self._training, self._all = policy, training, chosen
        self._taught, kept_out = chosen.held_out(training.held_out)
        self._measured = kept_out.some(training.measured) if training.held_out else kept_out
        self._drives: dict[int, RecordedDrive] = {}
        self._renderers: dict[str, SequenceRenderer] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes: what it is made from, without what it has read."""
        return _sequences, (self._policy.to_mapping(), self._training, self._all)

    def __len__(self) -> int:
        return self._training.steps * self._training.batch

    def __getitem__(self, number: int) -> Moments:
        training = self._training
        key = int(keyed_hash(training.seed, int(Stream.AGENT), number, 2)) % 2**62
        if number < len(self):
            return self._sequence(self._taught, key % len(self._taught), training.variation, key)
        unmoved = replace(training.variation, share=0.0)
        return self._sequence(self._measured, number - len(self), unmoved, key)

    def _sequence(self, chosen: Chosen, row: int, variation: Variation, key: int) -> Moments:
        number, last = int(chosen.drive[row]), int(chosen.moment[row])
        if number not in self._drives:
            self._drives[number] = read_drive(chosen.paths[number])
        drive = self._drives[number]
        length = self._training.length
        return self._renderer(drive).sequence(drive, last, length, variation, key)

    def _renderer(self, drive: RecordedDrive) -> SequenceRenderer:
        town = str(drive.facts["town"])
        if town not in self._renderers:
            depth = self._training.weights.depth > 0.0 and self._policy.camera is not None
            self._renderers[town] = SequenceRenderer(self._policy, *town_of(drive), depth=depth)
        return self._renderers[town]


def _sequences(policy: Mapping[str, Any], training: PerceiveConfig, chosen: Chosen) -> Sequences:
    return Sequences(PolicyConfig.from_mapping(policy), training, chosen)


def _order(training: PerceiveConfig, first_step: int) -> Iterator[int]:
    """Numbers of sequences from a step on; after some steps, of those that are measured on."""
    size, total = training.batch, training.steps * training.batch
    for step in range(first_step, training.steps):
        yield from range(step * size, (step + 1) * size)
        if training.measured_after(step + 1):
            yield from range(total, total + _measured(training))


def _measured(training: PerceiveConfig) -> int:
    """Sequences that are measured on, in whole batches."""
    return training.measured // training.batch * training.batch


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
        content = {
            "asked": self._asked(),
            "policy": self.policy.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
        }
        write_whole(path, lambda file: torch.save(content, file))

    def load(self, path: Path) -> None:
        """Goes on from a checkpoint.

        Raises:
            TrainingError: If it is not whole, or of another policy or training.
        """
        try:
            content = torch.load(path, weights_only=True, map_location=self._device())
            asked = content["asked"]
        except (OSError, RuntimeError, EOFError, KeyError, ValueError, TypeError,
                pickle.UnpicklingError, zipfile.BadZipFile) as error:  # fmt: skip
            raise TrainingError(
                f"{path} is not whole ({error!r}): delete it to begin again"
            ) from error
        if different := differences(asked, self._asked()):
            said = "; ".join(difference.was_is for difference in different)
            raise TrainingError(
                f"{path} is of another training ({said}): give the same options "
                f"to go on with it, or another folder to begin a new one"
            )
        self.policy.load_state_dict(content["policy"])
        self.optimiser.load_state_dict(content["optimiser"])
        self.step = content["step"]

    def update(self, moments: Moments) -> dict[str, float]:
        """One step; returns the terms of the loss.

        Raises:
            TrainingError: If the loss is not finite: the weights are left as they were.
        """
        for group in self.optimiser.param_groups:
            group["lr"] = self._learning_rate()
        self.perception.train()
        self.optimiser.zero_grad()
        heads, depth, targets = self._look(moments)
        terms = perception_losses(
            heads, depth, targets, self.policy.config.grid, self.config.weights
        )
        terms["total"].backward()
        norm = torch.nn.utils.clip_grad_norm_(self.perception.parameters(), self.config.clip)
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
            for _ in range(_measured(self.config) // self.config.batch):
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

    def _learning_rate(self) -> float:
        config = self.config
        if self.step < config.warm_up:
            return config.learning_rate * (self.step + 1) / config.warm_up
        done = (self.step - config.warm_up) / max(config.steps - config.warm_up, 1)
        return config.learning_rate * 0.5 * (1.0 + math.cos(math.pi * min(done, 1.0)))

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
    numbers = _order(config, training.step)
    batches = rendered(sequences, config.batch, numbers, joined, workers=workers)
    with closing(batches):
        _learn(training, batches, folder, tell, stop)
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
        append_row(folder / LOG_FILE, {"step": training.step, **row, **found})
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
