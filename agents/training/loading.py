"""From moments of drives to batches: which of them are samples, and processes that render them.

A sample is a function of (seed, its number over the whole training), so batches are the same for
any number of processes, and a run that was killed goes on with the batch that it had come to.
"""

from __future__ import annotations

import atexit
import os
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset

from agents.processes import births, live_for_parent
from agents.training.config import TrainConfig, TrainingError
from agents.training.distributed import ALONE, Team
from agents.training.emphasis import Emphasis, cumulated, meant
from agents.training.frames import DriveFileError, RecordedDrive, read_drive
from agents.training.moments import Moments, spread
from agents.training.samples import Batch, Renderer, Sample, batch_of
from agents.training.towns import training_plan, training_town
from agents.training.trainees import Config, trainee_from, trainee_of
from agents.training.variation import Variation
from di_envs.numerics.keyed_arrays import keyed_uniforms, stream_of
from di_envs.numerics.keyed_random import Stream, keyed_hash
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town

_MOMENT = stream_of("which moment is a sample")
PREFETCHED = 4  # batches that each process renders ahead


def town_of(drive: RecordedDrive) -> tuple[Town, Callable[[str], RoutePlan]]:
    """The town of a drive, and what plans its routes by their ids.

    Raises:
        TrainingError: If the drive was made on another version of it.
    """
    name = str(drive.facts["town"])
    town = training_town(name)
    if town.content_hash != drive.facts["town_hash"]:
        raise TrainingError(
            f"the drives in {name} were made on another version of that town: collect them again "
            f"into an empty folder"
        )
    return town, partial(training_plan, name)


class Samples(Dataset[Sample]):
    """Samples by their number over the whole training: step x batch + place in it.

    Numbers beyond the training's are the moments that it is measured on: unvaried but for weather,
    and the same each time.
    Drives and towns are read when they are first wanted, and kept: a few kB a moment.
    """

    def __init__(
        self,
        config: Config,
        training: TrainConfig,
        moments: Moments,
        emphasis: Emphasis | None = None,
    ) -> None:
        """Of a training.

        Args:
            config: What learns.
            training: How.
            moments: From what.
            emphasis: Of these moments; None where all count alike.
        """
        self._trainee, self._moments, self._emphasis = trainee_of(config), moments, emphasis
        self.training = training
        taught, kept_out = moments.held_out_rows(training.held_out)
        self._chosen = spread(taught, training.overfit) if training.overfit else taught
        self._measured = spread(kept_out, training.measured)
        weights = np.ones(len(self._chosen)) if emphasis is None else emphasis.weights[self._chosen]
        self._up_to = cumulated(weights)
        self._drives: dict[int, RecordedDrive] = {}
        self._renderers: dict[str, Renderer] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes: what it is made from, without what it has read."""
        config = self._trainee.config.to_mapping()
        return _samples, (config, self.training, self._moments, self._emphasis)

    def __len__(self) -> int:
        return self.training.steps * self.training.batch

    def __getitem__(self, number: int) -> Sample:
        training = self.training
        key = int(keyed_hash(training.seed, int(Stream.AGENT), number, 2)) % 2**62
        if number >= len(self):
            unmoved = replace(training.variation, share=0.0)
            return self._sample(int(self._measured[number - len(self)]), unmoved, key, number)
        mistold = 0.0 if training.overfit else training.mistold
        row = int(self._chosen[meant(self._up_to, keyed_uniforms(key, _MOMENT, 0, (1,)))[0]])
        return self._sample(row, training.varied, key, number, mistold)

    def _sample(
        self, row: int, variation: Variation, key: int, number: int, mistold: float = 0.0
    ) -> Sample:
        drive = self._drive(int(self._moments.drive[row]))
        return self._renderer(drive).sample(
            drive,
            int(self._moments.moment[row]),
            variation,
            key,
            past=self._past(number),
            mistold=mistold,
            known=None if self._emphasis is None else self._emphasis.known[row],
        )

    def _past(self, number: int) -> int:
        """Moments that are remembered: each number as often, and the same for a whole batch."""
        frames, training = self._trainee.past, self.training
        if training.overfit or number >= len(self):
            return frames
        step = number // training.batch
        return int(keyed_hash(training.seed, int(Stream.AGENT), step, 4)) % (frames + 1)

    def _drive(self, number: int) -> RecordedDrive:
        if number not in self._drives:
            self._drives[number] = read_drive(self._moments.paths[number])
        return self._drives[number]

    def _renderer(self, drive: RecordedDrive) -> Renderer:
        town = str(drive.facts["town"])
        if town not in self._renderers:
            self._renderers[town] = self._trainee.renderer(*town_of(drive))
        return self._renderers[town]


def _samples(config: Mapping[str, Any], *given: Any) -> Samples:
    return Samples(trainee_from(config).config, *given)


def order(training: TrainConfig, first_step: int, share: slice) -> Iterator[int]:
    """Numbers of samples from a step on; after some steps, of those that are measured on.

    Args:
        training: The whole of it.
        first_step: Where to begin.
        share: Rows of each batch that are wanted.
    """
    size, total = training.batch, training.steps * training.batch
    for step in range(first_step, training.steps):
        yield from range(step * size, (step + 1) * size)[share]
        if training.measured_after(step + 1):
            for first in range(total, total + training.measured, size):
                yield from range(first, first + size)[share]


def batches(
    samples: Samples, *, first_step: int = 0, workers: int = 0, team: Team = ALONE
) -> Generator[Batch, None, None]:
    """Batches from a step on, and after some steps those that are measured on; see `order`.

    Args:
        samples: Of the whole training.
        first_step: Where to begin.
        workers: Processes that render ahead of time; 0 renders here.
        team: Whose first, second, … part of each batch is wanted.
    """
    training = samples.training
    share = team.share(training.batch)
    yield from rendered(
        samples,
        share.stop - share.start,
        order(training, first_step, share),
        batch_of,
        workers=workers,
    )


def rendered(
    samples: Dataset[Any],
    size: int,
    numbers: Iterator[int],
    collate: Callable[[list[Any]], Any],
    *,
    workers: int,
) -> Generator[Any, None, None]:
    """Batches of samples by their numbers, each rendered when it is wanted, or ahead of time.

    Args:
        samples: All there are.
        size: Of a batch.
        numbers: Of the samples, one batch after the other.
        collate: Makes a batch of samples.
        workers: Processes that render ahead of time; 0 renders here.

    Raises:
        TrainingError: If a drive cannot be rendered; says why.
    """
    ahead: dict[str, Any] = {}
    if workers:
        torch.multiprocessing.set_sharing_strategy("file_system")
        ahead = {"multiprocessing_context": "spawn", "prefetch_factor": PREFETCHED}
    loader = DataLoader(
        samples,
        batch_size=size,
        sampler=numbers,
        collate_fn=collate,
        num_workers=workers,
        worker_init_fn=_begin_worker,
        **ahead,
    )
    try:
        with births():
            batches = iter(loader)
        yield from batches
    except (TrainingError, DriveFileError) as error:  # another process's brings its whole trace
        last = str(error).strip().splitlines()[-1]
        raise TrainingError(last.rpartition("Error: ")[2]) from error


def _begin_worker(_: int) -> None:
    """Lets the process that trains stop its workers, when it has saved.

    A worker leaves without tidying its interpreter up: torch may still be sending a batch that
    nobody waits for any more, and a thread that is ended in there aborts the process.
    """
    live_for_parent()
    atexit.register(os._exit, 0)
