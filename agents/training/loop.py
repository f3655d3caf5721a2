"""The whole of a training: step after step, with checkpoints, a log and checks on the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents.driveinsight.model import Policy
from agents.driveinsight.weights import save_pretrained
from agents.training.learning import Training
from agents.training.log import HELD_OUT, append_row, forget_rows_after, read_rows
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
