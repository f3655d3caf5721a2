"""From what is asked for to a training that can begin: its data, device, team, weights, samples.

A session goes on where its folder's checkpoint ends; else it begins with fresh weights, or with
those of another policy.
"""

from __future__ import annotations

import os
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from agents.driveinsight.config import PolicyConfig
from agents.networks.grid import WIDE_GRID, GridConfig
from agents.networks.weights import weights_digest
from agents.training.caching import MomentCache, cached
from agents.training.config import TrainConfig, TrainingError
from agents.training.data_card import data_card
from agents.training.distributed import Team, joined_team
from agents.training.emphasis import Emphasis
from agents.training.learning import Training
from agents.training.loading import Samples, batches
from agents.training.loop import CHECKPOINT_FILE
from agents.training.moments import Moments, load_moments
from agents.training.own_eyes import digest_of_rows, own_eyes
from agents.training.planning import PlanningSamples
from agents.training.samples import Batch
from agents.training.trainees import Config, trainee_of


@dataclass(frozen=True, kw_only=True)
class TrainingPlan:
    """What is to be trained, on what, and where.

    Attributes:
        policy: What is trained.
        training: How; what is known only once it begins (data, team, precision) is filled in then.
        data: Folders of drives.
        folder: For all that is written.
        init_from: A policy to begin with the weights of; None for fresh ones.
        eyes: A policy whose eyes it takes instead of that one's; None to keep them.
        device: `cpu`, `cuda`, or `auto`: a GPU if there is one.
        precision: `float32`, `bfloat16`, or `auto`: bfloat16 where the hardware has it built in.
        workers: Processes that render samples; None for the cores that are left.
        cache: Where moments are kept encoded.
        seen: Folders of what the policy's own eyes have seen of drives; see `own_eyes`.
    """

    policy: Config
    training: TrainConfig
    data: tuple[Path, ...]
    folder: Path
    init_from: Path | None = None
    eyes: Path | None = None
    device: str = "auto"
    precision: str = "auto"
    workers: int | None = None
    cache: Path = Path("cache")
    seen: tuple[Path, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Session:
    """A training that can begin or go on.

    Attributes:
        plan: What was asked for.
        training: At the step that it goes on from.
        samples: Of the whole training.
        resumed: Whether the folder held it.
        taken: Names of the tensors that are another policy's.
        left: Names of those of its tensors that fit nowhere.
    """

    plan: TrainingPlan
    training: Training
    samples: Samples | PlanningSamples
    resumed: bool
    taken: tuple[str, ...] = ()
    left: tuple[str, ...] = ()

    def batches(self) -> Generator[Batch, None, None]:
        """What it learns from, from its step on."""
        team, workers = self.training.team, self.plan.workers
        if isinstance(self.samples, PlanningSamples):
            return self.samples.batches(self.training.step, team)
        return batches(
            self.samples,
            first_step=self.training.step,
            workers=free_cores(team) if workers is None else workers,
            team=team,
        )

    def warm_up(self) -> None:
        """Renders a sample, so that kernels are compiled before several processes need them."""
        if isinstance(self.samples, Samples):
            self.samples[0]

    def about_data(self) -> Mapping[str, Any]:
        """The data card of each folder, by its name: where it lay here is nobody's business."""
        names = [folder.resolve().name for folder in self.plan.data]
        called = names if len(set(names)) == len(names) else [*map(str, self.plan.data)]
        return {name: data_card(at) for name, at in zip(called, self.plan.data, strict=True)}


@contextmanager
def joined(plan: TrainingPlan) -> Iterator[tuple[Team, str]]:
    """The team that trains, and this process's device; only the first process is heard."""
    torch.set_num_threads(plan.training.threads)
    with joined_team(chosen_device(plan.device)) as (team, device), one_talks(team):
        yield team, device


def begin(plan: TrainingPlan, team: Team, device: str) -> Session:
    """Reads the drives, and the weights that it goes on from or begins with.

    Raises:
        TrainingError: If there is nothing to learn from, or the folder holds another training.
        WeightsError: If there is no policy to begin with, whether asked for or a system's own.
        DriveFileError: If a drive is not whole.
    """
    begun_from = (trainee_of(plan.policy).pretrained, plan.init_from, plan.eyes)
    origins = [weights_digest(folder) for folder in begun_from if folder]
    moments = load_moments(plan.data, plan.training.standing_share)
    config = _filled_in(plan, moments, team, device, " ".join(origins))
    training = Training.begin(plan.policy, config, device, team)
    samples = _samples(plan, config, moments, team)
    checkpoint = plan.folder / CHECKPOINT_FILE
    if checkpoint.exists():
        training.load(checkpoint)
        return Session(plan=plan, training=training, samples=samples, resumed=True)
    taken: tuple[str, ...] = ()
    left: tuple[str, ...] = ()
    if plan.init_from is not None:
        taken, left = map(tuple, training.trainee.take(training.policy, plan.init_from))
    if plan.eyes is not None:
        training.trainee.take(training.policy, plan.eyes, only="perception.")
    return Session(
        plan=plan, training=training, samples=samples, resumed=False, taken=taken, left=left
    )


def _samples(
    plan: TrainingPlan, config: TrainConfig, moments: Moments, team: Team
) -> Samples | PlanningSamples:
    """What renders moments, or what has them encoded: the first of a team encodes them."""
    if config.rendered and (config.overfit or not config.interest):
        return Samples(plan.policy, config, moments)
    if config.rendered:
        cache = _encoded(moments, WIDE_GRID, plan, team)
        emphasis = Emphasis.of(cache.rows, config.interest)
        return Samples(plan.policy, config, cache.moments, emphasis)
    if not isinstance(plan.policy, PolicyConfig):
        raise TrainingError(
            f"'{plan.policy.name}' is a system of the zoo, which learns as a whole from what it is "
            f"shown: leave --plan-only out"
        )
    cache = _encoded(moments, plan.policy.grid, plan, team)
    own = own_eyes(cache.moments, plan.seen) if plan.seen else None
    return PlanningSamples.of(plan.policy, config, cache, own)


def _encoded(moments: Moments, grid: GridConfig, plan: TrainingPlan, team: Team) -> MomentCache:
    if team.first:
        cached(moments, grid, plan.cache)
    team.any(False)  # the others wait until it is there
    return cached(moments, grid, plan.cache)


def _filled_in(
    plan: TrainingPlan, moments: Moments, team: Team, device: str, weights: str
) -> TrainConfig:
    """The configuration with what only now is known: it decides what comes out, too."""
    learns_all = not plan.training.overfit and moments.drives > 1  # a single one is for learning
    convolves = plan.training.rendered and trainee_of(plan.policy).convolves
    try:
        return replace(
            plan.training,
            precision=chosen_precision(plan.precision, device, convolves=convolves),
            processes=team.size,
            held_out=plan.training.held_out if learns_all else 0.0,
            data=moments.digest,
            init_from=weights,
            seen=digest_of_rows(plan.seen),
        )
    except ValueError as error:
        raise TrainingError(str(error)) from error


def chosen_device(name: str) -> str:
    """`cpu` or `cuda`; `auto` takes a GPU if there is one."""
    if name != "auto":
        return name
    return "cuda" if torch.cuda.is_available() else "cpu"


def chosen_precision(name: str, device: str, *, convolves: bool = False) -> str:
    """`float32` or `bfloat16`; `auto` takes what the device has built in.

    Args:
        name: What was asked for.
        device: `cpu` or `cuda`.
        convolves: Whether most of the time goes into convolutions: these are faster in bfloat16
            with AVX-512 already (1.7 times, on an EPYC), products of small matrices are not.
    """
    if name != "auto":
        return name
    if device.startswith("cuda"):
        fast = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        built_in = torch.cpu.get_capabilities()
        fast = built_in.get("amx_bf16", False)
        fast = fast or (convolves and built_in.get("avx512_bf16", False))
    return "bfloat16" if fast else "float32"


def free_cores(team: Team) -> int:
    """Each process's part of the cores that are left when each has one; one at least."""
    return max((os.cpu_count() or 2) // team.here - 1, 1)


@contextmanager
def one_talks(team: Team) -> Iterator[None]:
    """Of a team only the first process is heard, but for errors."""
    if team.first:
        yield
        return
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
        yield
