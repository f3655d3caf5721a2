"""The moments of drives that training takes samples from, and which of these are kept out of it."""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.training.config import TrainingError
from agents.training.data_card import drive_paths
from agents.training.frames import FRAME_S, RecordedDrive, read_drive
from di_envs.numerics.keyed_arrays import keyed_uniforms
from di_envs.numerics.keyed_random import Stream, uniform

STANDING_MPS = 0.1


@dataclass(frozen=True, kw_only=True)
class Moments:
    """The moments of a folder of drives that training takes samples from.

    Attributes:
        paths: Of the drives.
        drive: (M,) index of the drive of each.
        moment: (M,) which moment of it: the newest of a sample.
        draws: (D,) a number of each drive, by its town and number: the lowest are held out.
        digest: Of all drives, so that a run goes on with the data that it began with.
    """

    paths: tuple[Path, ...]
    drive: NDArray[np.int64]
    moment: NDArray[np.int64]
    draws: NDArray[np.float64]
    digest: str

    def __len__(self) -> int:
        return len(self.drive)

    @property
    def drives(self) -> int:
        """How many drives they are of."""
        return len(np.unique(self.drive))

    def some(self, count: int) -> Moments:
        """So many of them, spread evenly: to see that a policy can learn them by heart."""
        return self._rows(spread(np.arange(len(self)), count))

    def thinned(self, most: int) -> Moments:
        """At most so many of them, keyed by drive and number: of more data, a part of the same."""
        share = most / max(len(self), 1)
        if share >= 1.0:
            return self
        names = (self.draws[self.drive] * 2.0**52).astype(np.uint64)  # one a drive
        drawn = keyed_uniforms(names, int(Stream.AGENT), self.moment, (1,))[:, 0]
        return self._rows(np.sort(np.argsort(drawn, kind="stable")[:most]))

    def held_out(self, share: float) -> tuple[Moments, Moments]:
        """Those to learn from, and those of the drives kept out; see `held_out_rows`."""
        taught, kept_out = self.held_out_rows(share)
        return self._rows(taught), self._rows(kept_out)

    def held_out_rows(self, share: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Which of them to learn from, and which are of drives kept out: one to half of these.

        Raises:
            TrainingError: If there are too few drives for that.
        """
        every = np.arange(len(self))
        if not share:
            return every, every[:0]
        drives = np.unique(self.drive)
        draws = self.draws[drives]
        count = min(max(int((draws < share).sum()), 1), len(drives) // 2)
        kept_out = np.isin(self.drive, drives[np.argsort(draws, kind="stable")[:count]])
        if not kept_out.any():
            raise TrainingError(
                "there is one drive alone, so none can be kept out of training to measure by: "
                "collect more, or give --held-out 0"
            )
        return every[~kept_out], every[kept_out]

    def _rows(self, rows: NDArray[np.int64]) -> Moments:
        return replace(self, drive=self.drive[rows], moment=self.moment[rows])


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
    pairs, draws = list[tuple[int, int]](), list[float]()
    for number, path in enumerate(paths):
        drive = read_drive(path)
        facts = drive.facts
        digest.update(f"{facts['town']} {facts['number']} {facts['town_hash']}".encode())
        digest.update(drive.poses().tobytes())
        if drive.shown is not None:
            digest.update(drive.shown.tobytes())
        name = zlib.crc32(f"{facts['town']} {facts['number']}".encode())
        draws.append(float(uniform(name, int(Stream.AGENT), 0, 5)))
        pairs += [(number, moment) for moment in _moments_of(drive, standing_share)]
    chosen = np.array(pairs, np.int64).reshape(-1, 2)
    if not len(chosen):
        raise TrainingError("the drives hold no moment to learn from: collect more")
    return Moments(
        paths=tuple(paths),
        drive=chosen[:, 0],
        moment=chosen[:, 1],
        draws=np.array(draws),
        digest=digest.hexdigest(),
    )


def _moments_of(drive: RecordedDrive, standing_share: float) -> Iterator[int]:
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


def spread(rows: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """So many of them, spread evenly: with repetitions where there are too few."""
    return rows[((np.arange(count) + 0.5) * len(rows) / count).astype(np.int64)]
