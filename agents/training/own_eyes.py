"""What a policy's own eyes see of drives: looked at once, for its planner to learn from.

A drive is looked at from its first moment to its last, each moment encoded once and remembered by
those after it, in a weather drawn for the drive. What is kept of a moment are the rows that were
read, half a kilobyte: with them a planner learns at hundreds of samples a second what its own eyes
miss, and what they see that is not there.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from agents.driveinsight.model import Policy
from agents.driveinsight.reading import read_seen
from agents.driveinsight.seen import OBJECT_COLUMNS, OBJECTS, SIGNAL_COLUMNS, SIGNALS
from agents.driveinsight.weights import from_pretrained
from agents.one_thread import one_thread
from agents.processes import in_order, processes
from agents.training.config import TrainingError
from agents.training.frames import RecordedDrive, read_drive
from agents.training.loading import town_of
from agents.training.moments import Moments
from agents.training.perceiving import look
from agents.training.sequences import Moments as Shown
from agents.training.sequences import SequenceRenderer
from agents.training.variation import Variation
from di_envs.files.whole import write_whole

CHUNK = 12  # moments that are encoded at once
SEEN = np.dtype(
    [
        ("objects", "f2", (OBJECTS, OBJECT_COLUMNS)),
        ("signals", "f2", (SIGNALS, SIGNAL_COLUMNS)),
    ]
)
_WEATHER_ALONE = Variation(share=0.0)


@dataclass(frozen=True, kw_only=True)
class LookJob:
    """A drive to be looked at.

    Attributes:
        drive: Its file.
        policy: Folder of the policy whose eyes look.
        path: Where the rows are kept.
    """

    drive: Path
    policy: Path
    path: Path


def look_jobs(drives: Sequence[Path], policy: Path, folder: Path) -> list[LookJob]:
    """The jobs for these drives; no two of one town may have the same number."""
    jobs = [LookJob(drive=d, policy=policy, path=_path(folder, d)) for d in drives]
    if len({job.path for job in jobs}) < len(jobs):
        raise TrainingError(
            "two drives have the same town and number, so one cache cannot hold what is seen of "
            "both: collect the second folder with another --first"
        )
    return jobs


def look_at(jobs: Sequence[LookJob], workers: int) -> Generator[int, None, None]:
    """Looks at the drives that were not looked at before; yields the moments of each.

    Raises:
        DriveFileError: If a drive is not whole.
        TrainingError: If one is of another version of its town.
        ChildProcessError: If a process died.
    """
    with processes(workers) as pool:
        yield from in_order(pool, look_job, jobs, ahead=2 * workers)


def look_job(job: LookJob) -> int:
    """Looks at a drive, unless that was done; returns its number of moments."""
    if job.path.exists():
        return len(_read(job.path))
    drive = read_drive(job.drive)
    renderer = _renderer(job.policy, str(drive.facts["town"]), job.drive)
    with one_thread(), torch.inference_mode():
        rows = seen_of(_policy(job.policy), renderer, drive)
    write_whole(job.path, lambda file: np.save(file, rows))
    return len(rows)


def seen_of(policy: Policy, renderer: SequenceRenderer, drive: RecordedDrive) -> NDArray[np.void]:
    """(F,) `SEEN` rows of all moments of a drive."""
    config, rows = policy.config, np.zeros(len(drive), SEEN)
    for first in range(0, len(drive), CHUNK):
        end = min(first + CHUNK, len(drive))
        begin = max(first - config.memory_frames, 0)  # what is remembered is encoded again
        length = end - begin
        moments = shown_of(renderer, drive, end - 1, length)
        assert policy.perception is not None
        heads, _ = look(policy.perception, moments, length)
        seen = read_seen(heads, config.grid)
        rows["objects"][first:end] = seen.objects[first - begin :].numpy()
        rows["signals"][first:end] = seen.signals[first - begin :].numpy()
    return rows


def shown_of(renderer: SequenceRenderer, drive: RecordedDrive, last: int, length: int) -> Shown:
    """What the sensors show at the moments of a drive that end at `last`, in its weather."""
    facts = drive.facts
    key = zlib.crc32(f"{facts['town']} {facts['number']} seen".encode())
    return renderer.sequence(drive, last, length, _WEATHER_ALONE, key)


@lru_cache(1)
def _policy(folder: Path) -> Policy:
    policy = from_pretrained(folder)
    if policy.perception is None:
        raise TrainingError(f"the policy in {folder} has no sensors: it sees nothing of drives")
    return policy


@lru_cache(8)
def _renderer(policy: Path, town: str, drive: Path) -> SequenceRenderer:
    return SequenceRenderer(_policy(policy).config, *town_of(read_drive(drive)), depth=False)


def _path(folder: Path, drive: Path) -> Path:
    return folder / f"{drive.parent.name}-{drive.stem}.npy"


def _read(path: Path) -> NDArray[np.void]:
    try:
        rows: NDArray[np.void] = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise TrainingError(f"{path} is not whole ({error}): delete it to look again") from error
    if rows.dtype != SEEN:
        raise TrainingError(f"{path} holds rows of another kind: delete it to look again")
    return rows


@dataclass(frozen=True, kw_only=True)
class OwnEyes:
    """What was seen at the moments of a cache.

    Attributes:
        rows: (M,) of `SEEN`, zeros where nobody looked.
        looked: (M,) whether somebody did.
    """

    rows: NDArray[np.void]
    looked: NDArray[np.bool_]


def own_eyes(moments: Moments, folders: Sequence[Path]) -> OwnEyes:
    """What was seen at these moments, in their order.

    Raises:
        TrainingError: If a file is not whole, or of another drive.
    """
    rows, looked = np.zeros(len(moments), SEEN), np.zeros(len(moments), bool)
    for number in np.unique(moments.drive):
        drive = moments.paths[number]
        for path in (_path(folder, drive) for folder in folders):
            if not path.exists():
                continue
            chosen, seen = np.flatnonzero(moments.drive == number), _read(path)
            last = int(moments.moment[chosen].max())
            if last >= len(seen):
                raise TrainingError(
                    f"{path} shows {len(seen)} moments, the drive {drive} has {last + 1} or more: "
                    f"it is of another drive"
                )
            rows[chosen], looked[chosen] = seen[moments.moment[chosen]], True
    if folders and not looked.any():
        raise TrainingError(f"{folders[0]} shows nothing of these drives: look at them first")
    return OwnEyes(rows=rows, looked=looked)


def digest_of_rows(folders: Sequence[Path]) -> str:
    """A hash of what was seen; empty for no folder."""
    if not folders:
        return ""
    digest = hashlib.blake2b(digest_size=16)
    for path in (path for folder in folders for path in sorted(folder.glob("*.npy"))):
        digest.update(path.name.encode())
        digest.update(hashlib.blake2b(path.read_bytes()).digest())
    return digest.hexdigest()
