"""Collects drives on a Ray cluster: driven wherever there is room, written here.

The machines need no folder in common: a drive comes back as the bytes of its file. These are the
same on equal footing only, so a machine whose CPU, versions or driver are not those of this one is
refused.
"""

from __future__ import annotations

import contextlib
import dataclasses
import tempfile
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents.processes import Pending, Pool
from agents.training.collect import DriveJob, Outcome
from agents.versions import agent_version
from di_envs.differences import differences
from di_envs.files.whole import write_whole
from leaderboard.records.footing import footing_here
from leaderboard.running.jobs import SetupError
from leaderboard.running.workers.ray_engine import cluster


def footing_of_driver(driver: str) -> Mapping[str, str]:
    """What the bits of a drive depend on beside its town and number, on this machine."""
    return {**footing_here(driver), "the driver": agent_version(driver)}


@dataclass(frozen=True, kw_only=True)
class Delivery:
    """What comes back from the cluster: what became of a drive, its file, and where it ran."""

    outcome: Outcome
    content: bytes
    footing: Mapping[str, str]


def drive_elsewhere(drive: Callable[[DriveJob], Outcome], job: DriveJob) -> Delivery:
    """Drives on whatever machine this runs on, and leaves nothing there."""
    with tempfile.TemporaryDirectory(prefix="driveinsight-") as folder:
        there = dataclasses.replace(job, folder=Path(folder))
        outcome = drive(there)
        path = there.dropped_path if outcome.why else there.path
        return Delivery(
            outcome=dataclasses.replace(outcome, job=job),
            content=path.read_bytes(),
            footing=footing_of_driver(job.driver),
        )


@dataclass(frozen=True, kw_only=True)
class RayPending:
    """A drive that the cluster was asked for; nothing is written before its `result`."""

    ray: Any
    reference: Any

    def result(self) -> Outcome:
        """Waits for the drive, and writes its file.

        Raises:
            SetupError: If it was driven on a machine that gives other bits, or not at all.
        """
        try:
            driven: Delivery = self.ray.get(self.reference)
        except self.ray.exceptions.RayError as error:
            raise SetupError(f"the cluster did not drive it: {error}") from error
        job = driven.outcome.job
        check_footing(driven.footing, footing_of_driver(job.driver))
        path = job.dropped_path if driven.outcome.why else job.path
        write_whole(path, driven.content)
        return driven.outcome

    def cancel(self) -> bool:
        """Leaves it, even while it is being driven: there will be no file."""
        self.ray.cancel(self.reference, force=True)
        return True


@dataclass(frozen=True, kw_only=True)
class Found:
    """A drive whose file is here already."""

    outcome: Outcome

    def result(self) -> Outcome:
        """What it holds."""
        return self.outcome

    def cancel(self) -> bool:
        """There is nothing to leave."""
        return True


@dataclass(frozen=True, kw_only=True)
class RayPool:
    """A cluster that drives; see `agents.processes.Pool`."""

    ray: Any

    def submit(self, work: Callable[[DriveJob], Outcome], job: DriveJob, /) -> Pending[Outcome]:
        """Has a job driven, unless its file is here."""
        if job.done:
            return Found(outcome=work(job))
        elsewhere = self.ray.remote(num_cpus=1)(drive_elsewhere)
        return RayPending(ray=self.ray, reference=elsewhere.remote(work, job))


@contextlib.contextmanager
def ray_pool(workers: int, address: str | None) -> Generator[Pool[DriveJob, Outcome]]:
    """A cluster for as long as this lasts.

    Args:
        workers: Drives at the same time, where the cluster is of this machine alone.
        address: Of a running cluster; None starts one on this machine, and ends it.

    Raises:
        SetupError: If there is no Ray, or no such cluster.
    """
    with cluster(workers, address) as ray:
        yield RayPool(ray=ray)


def check_footing(there: Mapping[str, str], here: Mapping[str, str]) -> None:
    """Refuses a machine that would give other bits than this one.

    Raises:
        SetupError: If its CPU, its versions or its driver are others.
    """
    if found := differences(there, here):
        said = "; ".join(difference.is_not for difference in found)
        raise SetupError(
            f"a machine of the cluster differs from this one ({said}), so its drives would have "
            "other bits: collect with machines that are alike, with the same packages and files"
        )
