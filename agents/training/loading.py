"""From a folder of drives to batches: which moments are samples, and processes that render them.

A sample is a function of (seed, its number over the whole training), so batches are the same for
any number of processes, and a run that was killed goes on with the batch that it had come to.
"""

from __future__ import annotations

import hashlib
import signal
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import DataLoader, Dataset

from agents.driveinsight.config import PolicyConfig
from agents.training.collect import drive_paths
from agents.training.frames import FRAME_S, Drive, DriveFileError, read_drive
from agents.training.samples import Batch, Renderer, Sample, batch_of
from agents.training.towns import load_training_town
from agents.training.train_config import TrainConfig, TrainingError
from di_envs.keyed_random import Stream, keyed_hash, uniform

STANDING_MPS = 0.1
PREFETCHED = 4  # batches that each process renders ahead


@dataclass(frozen=True, kw_only=True)
class Moments:
    """The moments of a folder of drives that training takes samples from.

    Attributes:
        paths: Of the drives.
        drive: (M,) index of the drive of each.
        moment: (M,) which moment of it: the newest of a sample.
        digest: Of all drives, so that a run goes on with the data that it began with.
    """

    paths: tuple[Path, ...]
    drive: NDArray[np.int64]
    moment: NDArray[np.int64]
    digest: str

    def __len__(self) -> int:
        return len(self.drive)

    def some(self, count: int) -> Moments:
        """So many of them, spread evenly: to see that a policy can learn them by heart."""
        rows = ((np.arange(count) + 0.5) * len(self) / count).astype(np.int64)
        return Moments(
            paths=self.paths, drive=self.drive[rows], moment=self.moment[rows], digest=self.digest
        )


def load_moments(folders: Sequence[Path], standing_share: float) -> Moments:
    """Finds the samples in folders of drives.

    Args:
        folders: Where `collect` put them.
        standing_share: See `TrainConfig`.

    Raises:
        TrainingError: If there is none.
        DriveFileError: If a file is not whole.
    """
    paths = []
    for folder in folders:
        found = drive_paths(folder)
        if not found:
            raise TrainingError(
                f"there are no drives in {folder}: run `driveinsight collect` first"
            )
        paths += found
    digest = hashlib.blake2b(digest_size=16)
    pairs: list[tuple[int, int]] = []
    for number, path in enumerate(paths):
        drive = read_drive(path)
        facts = drive.facts
        digest.update(f"{facts['town']} {facts['number']} {facts['town_hash']}".encode())
        digest.update(drive.poses().tobytes())
        if drive.shown is not None:
            digest.update(drive.shown.tobytes())
        pairs += [(number, moment) for moment in _moments_of(drive, standing_share)]
    chosen = np.array(pairs, np.int64).reshape(-1, 2)
    if not len(chosen):
        raise TrainingError("the drives hold no moment to learn from: collect more")
    return Moments(
        paths=tuple(paths), drive=chosen[:, 0], moment=chosen[:, 1], digest=digest.hexdigest()
    )


def _moments_of(drive: Drive, standing_share: float) -> Iterator[int]:
    """Those with a next one; of those in which the ego stands and stays, only a share."""
    speeds, number = drive.speeds(), int(drive.facts["number"])
    places = drive.poses()[:, :2]
    for moment in range(len(drive)):
        future = drive.future(moment)[:1]
        if not len(future):
            continue
        stays = np.hypot(*(future[0] - places[moment])) < STANDING_MPS * FRAME_S
        stands = speeds[moment] < STANDING_MPS and stays
        if not stands or float(uniform(number, int(Stream.AGENT), moment, 1)) < standing_share:
            yield moment


class Samples(Dataset[Sample]):
    """Samples by their number over the whole training: step x batch + place in it.

    Drives and towns are read when they are first wanted, and kept: a few kB a moment.
    """

    def __init__(self, config: PolicyConfig, training: TrainConfig, moments: Moments) -> None:
        self._config, self._training, self._moments = config, training, moments
        self._chosen = moments.some(training.overfit) if training.overfit else moments
        self._drives: dict[int, Drive] = {}
        self._renderers: dict[str, Renderer] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes: what it is made from, without what it has read."""
        return _samples, (self._config.to_mapping(), self._training, self._moments)

    def __len__(self) -> int:
        return self._training.steps * self._training.batch

    def __getitem__(self, number: int) -> Sample:
        key = int(keyed_hash(self._training.seed, int(Stream.AGENT), number, 2)) % 2**62
        row = key % len(self._chosen)
        drive = self._drive(int(self._chosen.drive[row]))
        moment = int(self._chosen.moment[row])
        return self._renderer(drive).sample(
            drive, moment, self._training.varied, key, past=self._past(number)
        )

    def _past(self, number: int) -> int:
        """Moments that are remembered: each number as often, and the same for a whole batch."""
        frames, training = self._config.memory_frames, self._training
        if training.overfit:
            return frames
        step = number // training.batch
        return int(keyed_hash(training.seed, int(Stream.AGENT), step, 4)) % (frames + 1)

    def _drive(self, number: int) -> Drive:
        if number not in self._drives:
            self._drives[number] = read_drive(self._moments.paths[number])
        return self._drives[number]

    def _renderer(self, drive: Drive) -> Renderer:
        town = str(drive.facts["town"])
        if town not in self._renderers:
            loaded, plans = load_training_town(town)
            if loaded.content_hash != drive.facts["town_hash"]:
                raise TrainingError(
                    f"the drives in {town} were made on another version of that town: collect them "
                    f"again into an empty folder"
                )
            self._renderers[town] = Renderer(self._config, loaded, plans)
        return self._renderers[town]


def _samples(config: Mapping[str, Any], training: TrainConfig, moments: Moments) -> Samples:
    return Samples(PolicyConfig.from_mapping(config), training, moments)


def batches(
    samples: Samples, batch: int, *, first_step: int = 0, workers: int = 0
) -> Generator[Batch, None, None]:
    """Batches from a step on.

    Args:
        samples: Of the whole training.
        batch: Samples in one.
        first_step: Where to begin.
        workers: Processes that render ahead of time; 0 renders here.
    """
    ahead: dict[str, Any] = {}
    if workers:
        torch.multiprocessing.set_sharing_strategy("file_system")
        ahead = {"multiprocessing_context": "spawn", "prefetch_factor": PREFETCHED}
    loader = DataLoader(
        samples,
        batch_size=batch,
        sampler=range(first_step * batch, len(samples)),
        collate_fn=batch_of,
        num_workers=workers,
        worker_init_fn=_begin_worker,
        **ahead,
    )
    try:
        yield from loader
    except (TrainingError, DriveFileError) as error:  # another process's brings its whole trace
        last = str(error).strip().splitlines()[-1]
        raise TrainingError(last.rpartition("Error: ")[2]) from error


def _begin_worker(_: int) -> None:
    """Ctrl-C is for the process that trains: it stops its workers when it has saved."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
