"""The stage in which a policy's own eyes look at drives once, for its planner to learn from."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import dataclass

from agents.training.data_card import drive_paths
from agents.training.own_eyes import look_at, look_job, look_jobs
from agents.training.recipes.kinds import POLICY_FOLDER, SEEN_FOLDER, Made, Progress, StageRun


@dataclass(frozen=True, kw_only=True)
class CacheStage:
    """A policy's eyes look at drives.

    Attributes:
        eyes: Stage of the policy.
        data: Stages whose drives it looks at.
    """

    eyes: str
    data: tuple[str, ...]


def run_cache(run: StageRun) -> Made | None:
    """Looks at drive after drive; those that are there stay."""
    drives = [path for folder in run.takes["data"] for path in drive_paths(folder)]
    jobs = look_jobs(drives, run.takes["eyes"][0] / POLICY_FOLDER, run.folder / SEEN_FOLDER)
    with run.compiling():
        look_job(jobs[0])
    moments, begun_s = 0, time.monotonic()
    with closing(look_at(jobs, run.machine.workers)) as looks:
        for done, count in enumerate(looks, start=1):
            moments += count
            rate = moments / (time.monotonic() - begun_s)
            about = f"{rate:.0f} moments/s"
            run.tell(Progress(done=done, total=len(jobs), unit="drives", about=about))
            if run.stop():
                return None
    return Made(samples=moments, said=f"{moments} moments of {len(jobs)} drives seen")
