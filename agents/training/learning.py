"""A policy being trained on collected drives: plain torch, one function a step, exact to resume.

Which samples make a step, how they are varied and what is hidden in them are functions of (seed,
step), so a run that was killed goes on from its checkpoint as if nothing had been.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import nn

from agents.training.checkpoints import load_checkpoint, rate_at, save_checkpoint
from agents.training.config import TrainConfig, TrainingError
from agents.training.distributed import ALONE, Team
from agents.training.samples import Batch
from agents.training.trainees import Config, Trainee, trainee_of
from di_envs.numerics.keyed_random import Stream, keyed_hash


@dataclass(kw_only=True)
class Training:
    """A policy being trained: all that a checkpoint holds, and who trains it."""

    trainee: Trainee
    policy: nn.Module
    optimiser: torch.optim.Optimizer
    config: TrainConfig
    step: int = 0
    team: Team = ALONE

    @classmethod
    def begin(
        cls, policy_config: Config, config: TrainConfig, device: str, team: Team = ALONE
    ) -> Training:
        """Fresh weights, drawn from the seed."""
        torch.manual_seed(config.seed)
        trainee = trainee_of(policy_config)
        policy = trainee.network().to(device)
        team.begin(policy)
        optimiser = torch.optim.AdamW(
            trainee.groups(policy, config),
            lr=config.learning_rate,
            weight_decay=config.weight_decay,
            fused=True,  # a planner's step takes a tenth less time
        )
        return cls(trainee=trainee, policy=policy, optimiser=optimiser, config=config, team=team)

    def save(self, path: Path) -> None:
        """Writes a checkpoint; the old one stays until the new one is whole.

        Of a team the first process does.
        """
        if not self.team.first:
            return
        save_checkpoint(path, self._asked(), self.policy, self.optimiser, self.step)

    def load(self, path: Path) -> None:
        """Goes on from a checkpoint.

        Raises:
            TrainingError: If it is not whole, or of another policy or training.
        """
        self.step = load_checkpoint(
            path,
            self._asked(),
            self.policy,
            self.optimiser,
            # what a field did that is newer than the checkpoint is what its default does
            defaults=TrainConfig().to_mapping(),
        )

    def update(self, batch: Batch) -> dict[str, float]:
        """One step on a batch, or on a share of it; returns the terms of the whole batch's loss.

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
            group["lr"] = rate * group["rate"]
        self.policy.train()
        self.optimiser.zero_grad()
        key = int(keyed_hash(config.seed, int(Stream.AGENT), self.step, 3)) % 2**62
        share = self.team.share(config.batch)
        found = self.trainee.learnt(self.policy, batch, config, key, share)
        # of a share, such that they sum up to the whole batch's
        terms = self.team.weighted(*found)
        values = self.team.summed(terms)
        if not math.isfinite(values["total"]):
            raise self._diverged(f"loss is {values['total']}")
        terms["total"].backward()
        self.team.sum_gradients(self.policy.parameters())
        norm = torch.nn.utils.clip_grad_norm_(self.policy.parameters(), config.clip)
        if not torch.isfinite(norm):
            raise self._diverged(f"gradient's norm is {float(norm)}")
        self.optimiser.step()
        self.step += 1
        return values

    def measure(self, data: Iterator[Batch]) -> dict[str, float]:
        """The mean waypoint loss on moments of drives kept out of training [m].

        Args:
            data: Where these moments come next; see `loading.order`.

        Returns:
            By column of the log: with nothing hidden, and without what the configuration says.
        """
        self.team.share_buffers(self.policy)
        self.policy.eval()
        looks = self.config.measured // self.config.batch
        sums = dict.fromkeys(self.config.measures, 0.0)
        with torch.no_grad():
            for _ in range(looks):
                batch = next(data)
                for column, names in self.config.measures.items():
                    found = self.trainee.measured(self.policy, batch, self.config, names)
                    sums[column] += self.team.summed(self.team.weighted(*found))["waypoints"]
        return {column: total / looks for column, total in sums.items()}

    def _diverged(self, what: str) -> TrainingError:
        return TrainingError(
            f"the {what} at step {self.step}: try a lower --learning-rate in another --output; the "
            f"last checkpoint is whole"
        )

    def _asked(self) -> dict[str, Any]:
        """What decides what comes out."""
        return {**self.config.to_mapping(), "policy": self.trainee.config.to_mapping()}
