"""Collects drives of the expert in training towns: states, not pictures; see `frames`.

Every drive is a function of (town, number), so collecting may be stopped, gone on with, and shared
out over any number of processes: the files are the same. Of a town the first drives are taken that
together have the moments asked for. No two numbers have a route in common.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from agents import load_agent
from agents.base import Agent, Requirements
from agents.processes import Pool, in_order, processes
from agents.training.corrections import corrected_drive
from agents.training.frames import (
    FRAME_S,
    DriveFileError,
    DriveLog,
    RecordedDrive,
    read_drive,
    read_dropped,
    write_drive,
    write_dropped,
)
from agents.training.hiding import EVERYTHING, Hiding, told_less
from agents.training.towns import block_of, town_files
from agents.versions import agent_version
from di_envs.differences import differences
from di_envs.numerics.keyed_random import Stream, keyed_hash
from di_envs.route_env import RouteEnv
from di_envs.world.event_names import EVENT_KEYS
from di_envs.world.kinds import EventKind
from di_envs.world.world import Event
from di_envs.world_version import WORLD_VERSION

STANDING_MPS = 0.1
EXPERT = "expert"
LEAST_MOMENTS = 10  # of a drive that is worth keeping
# Infractions for which the paper drops a route; the metres outside lanes come as an event too.
FAULTS = (
    *(EventKind.COLLISION_WALKER, EventKind.COLLISION_VEHICLE, EventKind.COLLISION_STATIC),
    *(EventKind.RED_LIGHT, EventKind.STOP_SIGN, EventKind.OUTSIDE_LANES),
    *(EventKind.ROUTE_DEVIATION, EventKind.BLOCKED),
)


@dataclass(frozen=True, kw_only=True)
class DriveJob:
    """One drive: the number says route and seed.

    Attributes:
        folder: Where it is kept.
        town: Name of the training town.
        number: Of the drive in it.
        driver: The agent that drives; any but `expert` is a learner, which the expert corrects.
        called: What its drives call it; empty for `driver`, which may say where its weights lie.
        hiding: What a learner is not told, in which share of its drives.
    """

    folder: Path
    town: str
    number: int
    driver: str = EXPERT
    called: str = ""
    hiding: Hiding = EVERYTHING

    @property
    def path(self) -> Path:
        """Where it is kept."""
        return self.folder / self.town / f"{self.number:05d}.npz"

    @property
    def dropped_path(self) -> Path:
        """What stands there instead when it is not worth keeping: why."""
        return self.path.with_suffix(".dropped.json")

    @property
    def done(self) -> bool:
        """Whether it was driven before."""
        return self.path.exists() or self.dropped_path.exists()


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a drive.

    Attributes:
        job: Which it was.
        moments: Kept; 0 for a dropped drive.
        why: It was dropped; empty if it was not.
        fresh: Whether it was driven now, rather than found.
    """

    job: DriveJob
    moments: int
    why: str = ""
    fresh: bool = False


def collect(
    folder: Path,
    towns: Sequence[str],
    frames: int,
    *,
    driver: str = EXPERT,
    called: str = "",
    hiding: Hiding = EVERYTHING,
    first: int = 0,
    workers: int = 1,
    pool: AbstractContextManager[Pool[DriveJob, Outcome]] | None = None,
) -> Generator[Outcome, None, None]:
    """Drives until each town has its share of the moments; yields each drive as it is there.

    It may be left at any time (`close`): what is there stays, and counts the next time.

    Args:
        folder: Where drives are kept; those that are there already count.
        towns: Names of training towns.
        frames: Moments in all.
        driver: See `DriveJob`.
        called: See `DriveJob`.
        hiding: See `DriveJob`.
        first: Number of each town's first drive.
        workers: Drives at the same time.
        pool: Where; None for processes of this machine.

    Raises:
        DriveFileError: If a file there is not whole, or of another driver, other weights or another
            version of the world.
        ChildProcessError: If a process died.
    """
    share = share_of(frames, towns)
    with pool or processes(workers) as drivers:
        for town in towns:
            jobs = (
                DriveJob(
                    folder=folder,
                    town=town,
                    number=number,
                    driver=driver,
                    called=called,
                    hiding=hiding,
                )
                for number in range(first, first + 10**6)
            )
            yield from _collect_town(drivers, jobs, share, workers)


def share_of(frames: int, towns: Sequence[str]) -> int:
    """The moments that each town is to have."""
    return -(-frames // len(towns))


def compile_for_drives(town: str) -> None:
    """Makes a town, and has all kernels compiled that a drive needs."""
    env = _environment(town, 0, EXPERT)
    observation, _ = env.reset(seed=0)
    agent = load_agent(EXPERT)
    control, _ = agent.act({**observation, "world": env.view}, agent.start(env.plan, 0))
    env.step(control)


def _collect_town(
    pool: Pool[DriveJob, Outcome], jobs: Iterator[DriveJob], share: int, workers: int
) -> Iterator[Outcome]:
    """Drives in order of their numbers, a few ahead, until the first have enough moments.

    What was driven beyond them is removed: with fewer processes it would not be there.
    """
    kept = 0
    drives = in_order(pool, drive_job, jobs, ahead=workers, in_vain=_remove)
    with closing(drives):
        for outcome in drives:
            kept += outcome.moments
            yield outcome
            if kept >= share:
                return


def _remove(outcome: Outcome) -> None:
    if outcome.fresh:
        outcome.job.path.unlink(missing_ok=True)
        outcome.job.dropped_path.unlink(missing_ok=True)


def drive_job(job: DriveJob) -> Outcome:
    """Drives, unless that was done before, and writes the drive or why it is dropped."""
    if job.dropped_path.exists():
        dropped = read_dropped(job.dropped_path)
        _check_same(job.dropped_path, dropped, job)
        return Outcome(job=job, moments=0, why=dropped["why"])
    if job.path.exists():
        drive = read_drive(job.path)
        _check_same(job.path, drive.facts, job)
        return Outcome(job=job, moments=len(drive))
    drive, why = _drive(job)
    if why:
        write_dropped(job.dropped_path, why, _common(job))
        return Outcome(job=job, moments=0, why=why, fresh=True)
    write_drive(job.path, drive)
    return Outcome(job=job, moments=len(drive), fresh=True)


@lru_cache(2)
def _driven_by(driver: str) -> Mapping[str, Any]:
    """Which version of a driver drives, and in which world."""
    return {"agent_version": agent_version(driver), "world_version": WORLD_VERSION}


def _common(job: DriveJob) -> Mapping[str, Any]:
    """What all drives of a folder have in common."""
    told = {} if job.driver == EXPERT else {"hiding": job.hiding.shares()}
    return {"driver": job.called or job.driver, **_driven_by(job.driver), **told}


def _check_same(path: Path, facts: Mapping[str, Any], job: DriveJob) -> None:
    """Refuses to go on where others have driven, or in another world."""
    ours = _common(job)
    theirs = {name: facts.get(name) for name in ours}
    if found := differences(theirs, ours):
        said = "; ".join(difference.was_is for difference in found)
        raise DriveFileError(f"{path} is none of these drives ({said}): name another --output")


@lru_cache(2)
def _environment(town: str, block: int, driver: str) -> RouteEnv:
    requires = Requirements.agreed(_driver(driver).requires)
    return RouteEnv(
        observations=requires.observations,
        control_dt_s=requires.control_dt_s,
        **{**requires.options, **town_files(town, block).options()},
    )


@lru_cache(1)
def _driver(driver: str) -> Agent[Any]:
    return load_agent(driver)


def _drive(job: DriveJob) -> tuple[RecordedDrive, str]:
    """A drive, and why it is not worth keeping; empty if it is."""
    env = _environment(job.town, block_of(job.number), job.driver)
    seed = int(keyed_hash(job.number, int(Stream.ROUTE), 1, 0)) % 2**32
    observation, _ = env.reset(seed=seed, options={"route": job.number % len(env.route_ids)})
    shown = None
    if job.driver == EXPERT:
        log, events, finished = _driven(env, observation, seed)
    else:
        hidden = job.hiding.hidden_in(job.town, job.number)
        learner = told_less(_driver(job.driver), hidden)
        log, shown, events, finished = corrected_drive(env, learner, observation, seed)
    facts = {
        "town": job.town,
        "town_hash": env.world.town.content_hash,
        "number": job.number,
        "route_id": env.plan.route_id,
        "seed": seed,
        "finished": finished,
        "scenarios": _scenarios(events),
        **_common(job),
    }
    if job.driver != EXPERT:
        facts["hidden"] = list(hidden)
    drive = dataclasses.replace(log.drive(facts), shown=shown)
    if finished == "timeout" and shown is None:
        drive = without_standing_tail(drive)
    faults = [EVENT_KEYS[event.kind] for event in events if event.kind in FAULTS]
    if faults and shown is None:
        return drive, f"infractions: {', '.join(faults)}"
    if len(drive) < LEAST_MOMENTS:
        return drive, f"{len(drive)} moments only"
    return drive, ""


def _driven(
    env: RouteEnv, observation: dict[str, Any], seed: int
) -> tuple[DriveLog, list[Event], str]:
    """The expert drives a route that was just begun: the log, the events and how it ended."""
    agent = _driver(EXPERT)
    memory = agent.start(env.plan, seed)
    every = round(FRAME_S / env.config.control_dt_s)
    log, step, events, ended = DriveLog(view=env.view), 0, list[Event](), ""
    while not ended:
        control, memory = agent.act({**observation, "world": env.view}, memory)
        if step % every == 0:
            log.add(control)
        observation, _, terminated, truncated, info = env.step(control)
        events += info["events"]
        ended, step = str(info["finished"]) if terminated or truncated else "", step + 1
    return log, events, ended


def without_standing_tail(drive: RecordedDrive) -> RecordedDrive:
    """The drive up to where it stood for good: a route that timed out ends in waiting."""
    moving = np.flatnonzero(drive.speeds() > STANDING_MPS)
    return drive.cut(int(moving[-1]) + 1 if len(moving) else 0)


def _scenarios(events: Sequence[Event]) -> dict[str, int]:
    types = Counter(str(int(e.value)) for e in events if e.kind == EventKind.SCENARIO)
    return dict(sorted(types.items()))
