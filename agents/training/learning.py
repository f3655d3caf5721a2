"""A policy being trained on collected drives: plain torch, one function a step, exact to resume.

Which samples make a step, how they are varied and what is hidden in them are functions of (seed,
step), so a run that was killed goes on from its checkpoint as if nothing had been.
"""

from __future__ import annotations

import math
import pickle
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import nn

from agents.training.config import TrainConfig, TrainingError
from agents.training.distributed import ALONE, Team
from agents.training.samples import Batch
from agents.training.trainees import Config, Trainee, trainee_of
from di_envs.differences import differences
from di_envs.files.received import check_ordinary
from di_envs.files.whole import write_whole
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
        groups = trainee.groups(policy, config)
        optimiser = torch.optim.AdamW(
            groups, lr=config.learning_rate, weight_decay=config.weight_decay
        )
        return cls(trainee=trainee, policy=policy, optimiser=optimiser, config=config, team=team)

    def save(self, path: Path) -> None:
        """Writes a checkpoint; the old one stays until the new one is whole.

        Of a team the first process does.
        """
        if not self.team.first:
            return
        content = {
            "policy_config": self.trainee.config.to_mapping(),
            "config": self.config.to_mapping(),
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
        device = next(self.policy.parameters()).device
        try:
            check_ordinary(path)
            content = torch.load(path, weights_only=True, map_location=device)
            policy, config = content["policy_config"], content["config"]
        except (OSError, RuntimeError, EOFError, KeyError, ValueError, TypeError, IndexError,
                AttributeError, pickle.UnpicklingError, zipfile.BadZipFile) as error:  # fmt: skip
            raise _not_whole(path, error) from error
        different = [
            *differences(policy, self.trainee.config.to_mapping()),
            # what a field did that is newer than the checkpoint is what its default does
            *differences({**TrainConfig().to_mapping(), **config}, self.config.to_mapping()),
        ]
        if different:
            said = "; ".join(difference.was_is for difference in different)
            raise TrainingError(
                f"{path} is of another training ({said}): give the same options "
                f"to go on with it, or another --output to begin a new one"
            )
        try:
            self.policy.load_state_dict(content["policy"])
            self.optimiser.load_state_dict(content["optimiser"])
            self.step = int(content["step"])
        except (RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
            raise _not_whole(path, error) from error

    def update(self, batch: Batch) -> dict[str, float]:
        """One step on a batch, or on a share of it; returns the terms of the whole batch's loss.

        Raises:
            TrainingError: If the loss is not finite: the weights are left as they were.
        """
        for group in self.optimiser.param_groups:
            group["lr"] = self._learning_rate() * group["rate"]
        self.policy.train()
        self.optimiser.zero_grad()
        key = int(keyed_hash(self.config.seed, int(Stream.AGENT), self.step, 3)) % 2**62
        share = self.team.share(self.config.batch)
        found = self.trainee.learnt(self.policy, batch, self.config, key, share)
        # of a share, such that they sum up to the whole batch's
        terms = self.team.weighted(*found)
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

    def _learning_rate(self) -> float:
        config = self.config
        if self.step < config.warm_up:
            return config.learning_rate * (self.step + 1) / config.warm_up
        done = (self.step - config.warm_up) / max(config.steps - config.warm_up, 1)
        return config.learning_rate * 0.5 * (1.0 + math.cos(math.pi * min(done, 1.0)))


def _not_whole(path: Path, error: Exception) -> TrainingError:
    return TrainingError(f"{path} is not whole ({error!r}): delete it to begin again")
