"""The whole of a training: step after step, with checkpoints, a log and checks on the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from torch import nn

from agents.training.board import BOARD_FOLDER, Tell, board
from agents.training.learning import Training
from agents.training.log import append_row, forget_rows_after, read_rows
from agents.training.model_card import model_card
from agents.training.samples import Batch

CHECKPOINT_FILE = "checkpoint.pt"
LOG_FILE = "log.csv"
CHECKS_FILE = "checks.csv"
POLICY_FOLDER = "policy"
LOG_EVERY = 20  # steps whose mean makes a row of the log
CHECKPOINT_EVERY_S = 120.0


@dataclass(frozen=True, kw_only=True)
class Checks:
    """How well the policy drives, looked at now and then; the best one is kept.

    Attributes:
        every: Steps between two checks; there is one after the last step too.
        score: Drives with the policy; returns numbers by name, `driving_score` among them. None if
            it was asked to stop: the check is made when the training goes on.
    """

    every: int
    score: Callable[[nn.Module], Mapping[str, float] | None]


def train(
    training: Training,
    data: Iterator[Batch],
    folder: Path,
    *,
    on_step: Callable[[int, dict[str, float]], None] = lambda step, terms: None,
    stop: Callable[[], bool] = lambda: False,
    checks: Checks | None = None,
    about_data: Mapping[str, Any] | None = None,
    wandb: str = "",
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
        wandb: Project of Weights & Biases that is told what the log is; empty for none.

    Returns:
        Whether the last step was done.

    Raises:
        TrainingError: If the loss is not finite.
    """
    with board(
        folder / BOARD_FOLDER,
        first_step=training.step + 1,
        project=wandb,
        about=training.config.to_mapping(),
        told=training.team.first,
    ) as tell:
        loop = _Loop(
            training=training,
            data=data,
            folder=folder,
            checks=checks,
            about_data=about_data or {},
            tell=tell,
        )
        loop.begin()
        while loop.checked():
            if loop.last_is_done or training.team.any(stop()):
                loop.end()
                break
            terms = loop.step()
            on_step(training.step, terms)
            loop.log()
        return loop.last_is_done and not loop.left


@dataclass(kw_only=True)
class _Loop:
    """The steps of a training, and what is written between them.

    Attributes:
        tell: Takes the rows of the log for boards that people watch.
        left: Whether a check was left, as it was asked to stop.
        sums: By loss term, over the steps since the last row of the log.
        count: Of these steps.
        saved_s: When the last checkpoint was written.
    """

    training: Training
    data: Iterator[Batch]
    folder: Path
    checks: Checks | None
    about_data: Mapping[str, Any]
    tell: Tell
    left: bool = False
    sums: dict[str, float] = field(default_factory=dict)
    count: int = 0
    saved_s: float = field(default_factory=time.monotonic)

    @property
    def last_is_done(self) -> bool:
        return self.training.step == self.training.config.steps

    def begin(self) -> None:
        """Makes the folder; what was logged after the checkpoint comes again."""
        if self.training.team.first:
            self.folder.mkdir(parents=True, exist_ok=True)
            for name in (LOG_FILE, CHECKS_FILE):
                forget_rows_after(self.folder / name, self.training.step)

    def checked(self) -> bool:
        """Drives with the policy if that is due; False if any of the team left its check."""
        if self.training.team.first and self._check_is_due():
            self.save()
            self.left = not self._check()
        self.left = self.training.team.any(self.left)
        return not self.left

    def step(self) -> dict[str, float]:
        """Learns from the next batch; returns the terms of its loss."""
        terms = self.training.update(next(self.data))
        for name, value in terms.items():
            self.sums[name] = self.sums.get(name, 0.0) + value
        self.count += 1
        return terms

    def log(self) -> None:
        """Writes a row after some steps and the last, and a checkpoint after some minutes.

        Checkpoints come together with a row, so that rows are the same however often a run is cut.
        """
        if self.training.step % LOG_EVERY and not self.last_is_done:
            return
        row = self._row()
        if self.training.team.first:
            append_row(self.folder / LOG_FILE, row)
            self.tell(row)
        if time.monotonic() - self.saved_s > CHECKPOINT_EVERY_S:
            self.save()
            self.saved_s = time.monotonic()

    def _row(self) -> dict[str, float | None]:
        """Means since the last row; how it does on drives kept out, where that is due."""
        row: dict[str, float | None] = {"step": self.training.step}
        row |= {name: value / self.count for name, value in self.sums.items()}
        self.sums, self.count = {}, 0
        config = self.training.config
        if config.held_out:
            due = config.measured_after(self.training.step)
            row |= self.training.measure(self.data) if due else dict.fromkeys(config.measures)
        return row

    def save(self) -> None:
        """Writes a checkpoint."""
        self.training.save(self.folder / CHECKPOINT_FILE)

    def end(self) -> None:
        """Writes the last checkpoint; and the policy, unless checks have chosen one."""
        self.save()
        if self.last_is_done and not self.checks and self.training.team.first:
            self._keep()

    def _check_is_due(self) -> bool:
        """Whether a check belongs here that was not made before."""
        step = self.training.step
        if not self.checks or step == 0 or (step % self.checks.every and not self.last_is_done):
            return False
        return all(row["step"] != step for row in read_rows(self.folder / CHECKS_FILE))

    def _check(self) -> bool:
        """Drives with the present policy, and keeps it if none before drove better."""
        assert self.checks is not None
        before = [row["driving_score"] for row in read_rows(self.folder / CHECKS_FILE)]
        found = self.checks.score(self.training.policy)
        if found is None:
            return False
        append_row(self.folder / CHECKS_FILE, {"step": self.training.step, **found})
        checked = {f"check/{name}": value for name, value in found.items()}
        self.tell({"step": self.training.step, **checked})
        if found["driving_score"] >= max(before, default=0.0):
            self._keep()
        return True

    def _keep(self) -> None:
        """Writes the present policy with its card."""
        training = self.training
        card = model_card(
            training.trainee.about(training.policy),
            training.config,
            step=training.step,
            log=read_rows(self.folder / LOG_FILE),
            checks=read_rows(self.folder / CHECKS_FILE),
            about_data=self.about_data,
        )
        training.trainee.save(training.policy, self.folder / POLICY_FOLDER, card)
