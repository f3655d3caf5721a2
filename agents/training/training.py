"""Trains a policy on collected drives: plain torch, one function a step, exact to resume.

Which samples make a step, how they are varied and what is hidden in them are functions of (seed,
step), so a run that was killed goes on from its checkpoint as if nothing had been.
"""

from __future__ import annotations

import dataclasses
import math
import os
import pickle
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from agents.driveinsight.config import TOKENS, PolicyConfig
from agents.driveinsight.losses import Targets, counts, losses
from agents.driveinsight.memory import MemoryBank
from agents.driveinsight.model import Inputs, Output, Policy
from agents.driveinsight.weights import save_pretrained
from agents.training.distributed import ALONE, Team
from agents.training.model_card import model_card
from agents.training.samples import Batch, hidden_components
from agents.training.train_config import TrainConfig, TrainingError
from agents.training.train_log import HELD_OUT, append_row, forget_rows_after, read_rows
from di_envs.keyed_random import Stream, keyed_hash

CHECKPOINT_FILE = "checkpoint.pt"
LOG_FILE = "log.csv"
CHECKS_FILE = "checks.csv"
POLICY_FOLDER = "policy"
LOG_EVERY = 20  # steps whose mean makes a row of the log
CHECKPOINT_EVERY_S = 120.0
_PLANNING = ("prompt.", "planner.")  # what a policy that sees nothing has too


@dataclass(kw_only=True)
class Training:
    """A policy being trained: all that a checkpoint holds, and who trains it."""

    policy: Policy
    optimiser: torch.optim.Optimizer
    config: TrainConfig
    step: int = 0
    team: Team = ALONE

    @classmethod
    def begin(
        cls, policy_config: PolicyConfig, config: TrainConfig, device: str, team: Team = ALONE
    ) -> Training:
        """Fresh weights, drawn from the seed."""
        torch.manual_seed(config.seed)
        policy = Policy(policy_config).to(device)
        team.begin(policy)
        optimiser = torch.optim.AdamW(
            _groups(policy, config), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        return cls(policy=policy, optimiser=optimiser, config=config, team=team)

    def save(self, path: Path) -> None:
        """Writes a checkpoint; the old one stays until the new one is whole.

        Of a team the first process does.
        """
        if not self.team.first:
            return
        part = path.with_suffix(".part")
        torch.save(
            {
                "policy_config": self.policy.config.to_mapping(),
                "config": self.config.to_mapping(),
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
        device = next(self.policy.parameters()).device
        try:
            content = torch.load(path, weights_only=True, map_location=device)
            policy, config = content["policy_config"], content["config"]
        except (OSError, RuntimeError, EOFError, KeyError, ValueError, TypeError,
                pickle.UnpicklingError, zipfile.BadZipFile) as error:  # fmt: skip
            raise TrainingError(
                f"{path} is not whole ({error!r}): delete it to begin again"
            ) from error
        different = [
            *_differences(policy, self.policy.config.to_mapping()),
            # what a field did that is newer than the checkpoint is what its default does
            *_differences({**TrainConfig().to_mapping(), **config}, self.config.to_mapping()),
        ]
        if different:
            raise TrainingError(
                f"{path} is of another training ({', '.join(different)}): give the same options "
                f"to go on with it, or another --output to begin a new one"
            )
        self.policy.load_state_dict(content["policy"])
        self.optimiser.load_state_dict(content["optimiser"])
        self.step = content["step"]

    def update(self, batch: Batch) -> dict[str, float]:
        """One step on a batch, or on a share of it; returns the terms of the whole batch's loss.

        Raises:
            TrainingError: If the loss is not finite: the weights are left as they were.
        """
        for group in self.optimiser.param_groups:
            group["lr"] = self._learning_rate() * group["rate"]
        self.policy.train()
        self.optimiser.zero_grad()
        hidden = self._hidden(self.config.batch)[self.team.share(self.config.batch)]
        terms = self._terms(batch, hidden)
        values = self.team.summed(terms)
        if not math.isfinite(values["total"]):
            raise self._diverged(f"loss is {values['total']}")
        terms["total"].backward()
        self.team.sum_gradients(self.policy.parameters())
        norm = torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.config.clip)
        if not torch.isfinite(norm):
            raise self._diverged(f"gradient's norm is {float(norm)}")
        self.optimiser.step()
        self.step += 1
        return values

    def measure(self, data: Iterator[Batch]) -> float:
        """The mean waypoint loss on moments of drives kept out of training, nothing hidden [m].

        Args:
            data: Where these moments come next; see `loading.order`.
        """
        self.team.share_buffers(self.policy)
        self.policy.eval()
        looks = self.config.measured // self.config.batch
        share = self.team.share(self.config.batch)
        everything = torch.ones(share.stop - share.start, len(TOKENS))
        with torch.no_grad():
            found = [
                self.team.summed(self._terms(next(data), everything))["waypoints"]
                for _ in range(looks)
            ]
        return sum(found) / looks

    def _terms(self, batch: Batch, hidden: Tensor) -> dict[str, Tensor]:
        """The terms of the loss; of a share, such that they sum up to the whole batch's."""
        mixed = self.config.precision == "bfloat16"
        output, targets = look(self.policy, batch, hidden, mixed=mixed)
        terms = losses(output, targets, self.config.loss)
        return self.team.weighted(terms, counts(targets, self.config.loss))

    def _diverged(self, what: str) -> TrainingError:
        return TrainingError(
            f"the {what} at step {self.step}: try a lower --learning-rate in another --output; the "
            f"last checkpoint is whole"
        )

    def _learning_rate(self) -> float:
        config = self.config
        if self.step < config.warm_up:
            return config.learning_rate * (self.step + 1) / config.warm_up
        done = (self.step - config.warm_up) / max(config.steps - config.warm_up, 1)
        return config.learning_rate * 0.5 * (1.0 + math.cos(math.pi * min(done, 1.0)))

    def _hidden(self, size: int) -> Tensor:
        """(B, 10) which components are hidden (0) in this step."""
        if self.config.overfit:
            return torch.ones(size, len(TOKENS))
        key = int(keyed_hash(self.config.seed, int(Stream.AGENT), self.step, 3)) % 2**62
        return hidden_components(self.policy.config, size, key)


def _groups(policy: Policy, config: TrainConfig) -> list[dict[str, Any]]:
    """Parameters by how fast they learn: those that see, and those that plan."""
    seeing, planning = list[nn.Parameter](), list[nn.Parameter]()
    for name, parameter in policy.named_parameters():
        (planning if name.startswith(_PLANNING) else seeing).append(parameter)
    groups = ((seeing, 1.0), (planning, config.planner_rate))
    return [{"params": params, "rate": rate} for params, rate in groups if params]


def look(
    policy: Policy, batch: Batch, hidden: Tensor, *, mixed: bool = False
) -> tuple[Output, Targets]:
    """What a policy says at the newest moment of a batch, and the targets there.

    The moments before it are remembered, without their gradients. A sample that begins later than
    others, at its drive's start, remembers nothing of the time before.

    Args:
        policy: On any device.
        batch: Of T moments.
        hidden: (B, 10) 0 for components that are hidden.
        mixed: In mixed precision (bfloat16).
    """
    device = next(policy.parameters()).device
    hidden, bank = hidden.to(device), None

    def seen(t: int, bank: MemoryBank | None) -> tuple[Output, Inputs]:
        inputs = _to(batch.inputs[t], device)
        inputs = dataclasses.replace(inputs, present=inputs.present * hidden)
        with torch.autocast(device.type, torch.bfloat16, enabled=mixed):
            return policy(inputs, bank), inputs

    for t in range(len(batch.inputs) - 1):
        with torch.no_grad():
            output, inputs = seen(t, bank)
        assert output.bev is not None, "only a memory needs a past"
        assert inputs.pose is not None
        bank = bank or policy.empty_bank(len(hidden), like=output.bev)
        bank = bank.remember(output.bev, inputs.pose)
        begun = batch.begun[t].bool().to(device)
        valid = torch.cat([bank.valid[:, :1] & begun[:, None], bank.valid[:, 1:]], dim=1)
        bank = dataclasses.replace(bank, valid=valid)
    return seen(len(batch.inputs) - 1, bank)[0], _to(batch.targets, device)


def _to(values: Any, device: torch.device) -> Any:
    """A bundle of tensors on a device."""

    def moved(value: Any) -> Any:
        if isinstance(value, Tensor):
            return value.to(device, non_blocking=True)
        return {name: moved(item) for name, item in value.items()} if value else value

    fields = dataclasses.fields(values)
    return type(values)(**{field.name: moved(getattr(values, field.name)) for field in fields})


def _differences(saved: Mapping[str, Any], ours: Mapping[str, Any]) -> list[str]:
    """What was otherwise when a checkpoint was written, in words."""
    return [
        f"{name} was {saved.get(name, 'not there')}, is {value}"
        for name, value in ours.items()
        if saved.get(name, None) != value
    ]


@dataclass(frozen=True, kw_only=True)
class Checks:
    """How well the policy drives, looked at now and then; the best one is kept.

    Attributes:
        every: Steps between two checks; there is one after the last step too.
        score: Drives with the policy; returns numbers by name, `driving_score` among them. None if
            it was asked to stop: the check is made when the training goes on.
    """

    every: int
    score: Callable[[Policy], Mapping[str, float] | None]


def train(
    training: Training,
    data: Iterator[Batch],
    folder: Path,
    *,
    on_step: Callable[[int, dict[str, float]], None] = lambda step, terms: None,
    stop: Callable[[], bool] = lambda: False,
    checks: Checks | None = None,
    about_data: Mapping[str, Any] | None = None,
) -> bool:
    """Trains to the last step; writes checkpoints, a log and the policy on the way.

    Args:
        training: Fresh, or loaded from a checkpoint.
        data: Batches from `training.step` on.
        folder: For all that is written.
        on_step: Told each step's number and loss terms.
        stop: Asked after each step whether to stop; a checkpoint is written then.
        checks: Drives now and then; the best policy is kept. None keeps the last one.
        about_data: The data card, for the model card.

    Returns:
        Whether the last step was done.

    Raises:
        TrainingError: If the loss is not finite.
    """
    team, config = training.team, training.config
    if team.first:
        folder.mkdir(parents=True, exist_ok=True)
        for name in (LOG_FILE, CHECKS_FILE):
            forget_rows_after(folder / name, training.step)
    keep = _keeper(training, folder, about_data or {})
    saved_s, sums, count, last = time.monotonic(), dict[str, float](), 0, config.steps
    while True:
        left = False
        if checks and team.first and _due(training, checks, folder):
            training.save(folder / CHECKPOINT_FILE)
            left = not _check(training, checks, folder, keep)
        if team.any(left):
            return False
        if training.step == last or team.any(stop()):
            break
        terms = training.update(next(data))
        on_step(training.step, terms)
        for name, value in terms.items():
            sums[name] = sums.get(name, 0.0) + value
        count += 1
        if training.step % LOG_EVERY == 0 or training.step == last:
            row: dict[str, float | None] = {name: value / count for name, value in sums.items()}
            if config.held_out:
                due = config.measured_after(training.step)
                row[HELD_OUT] = training.measure(data) if due else None
            if team.first:
                append_row(folder / LOG_FILE, {"step": training.step, **row})
            sums, count = {}, 0
            # together with a row, so that rows are the same however often a run is cut off
            if time.monotonic() - saved_s > CHECKPOINT_EVERY_S:
                training.save(folder / CHECKPOINT_FILE)
                saved_s = time.monotonic()
    training.save(folder / CHECKPOINT_FILE)
    if training.step == last and not checks and team.first:
        keep()
    return training.step == last


def _keeper(training: Training, folder: Path, about_data: Mapping[str, Any]) -> Callable[[], None]:
    """Writes the present policy with its card."""

    def keep() -> None:
        card = model_card(
            training.policy,
            training.config,
            step=training.step,
            log=read_rows(folder / LOG_FILE),
            checks=read_rows(folder / CHECKS_FILE),
            about_data=about_data,
        )
        save_pretrained(training.policy, folder / POLICY_FOLDER, card)

    return keep


def _due(training: Training, checks: Checks, folder: Path) -> bool:
    """Whether a check belongs here that was not made before."""
    step = training.step
    if step == 0 or (step % checks.every and step != training.config.steps):
        return False
    return all(row["step"] != step for row in read_rows(folder / CHECKS_FILE))


def _check(training: Training, checks: Checks, folder: Path, keep: Callable[[], None]) -> bool:
    """Drives with the present policy, and keeps it if none before drove better."""
    before = [row["driving_score"] for row in read_rows(folder / CHECKS_FILE)]
    found = checks.score(training.policy)
    if found is None:
        return False
    append_row(folder / CHECKS_FILE, {"step": training.step, **found})
    if found["driving_score"] >= max(before, default=0.0):
        keep()
    return True
