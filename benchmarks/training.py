"""How fast data are collected and rendered, and policies trained, on one core of CPU.

python benchmarks/training.py              all but the loader with two processes: about two minutes
python benchmarks/training.py --workers 2  the loader with two processes too; wants two free cores

CPU time counts, so other work on the machine disturbs little; the loader is timed by the clock.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import torch
import tyro

from agents.driveinsight.config import config_named
from agents.training.caching import cached
from agents.training.collect import DriveJob, drive_job
from agents.training.config import PLANNING, TrainConfig
from agents.training.data_card import drive_paths
from agents.training.learning import Training
from agents.training.loading import Samples, batches
from agents.training.moments import Moments, load_moments
from agents.training.planning import PlanningSamples

TOWNS = ("small_grid", "suburb")
CONFIGS = ("driveinsight", "driveinsight-told", "tiny")
DRIVES = 8  # of each town
BATCH = 16
PLANNED = 128  # samples of a batch of a planner alone


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """What to time."""

    workers: int = 0
    """Time the loader with so many processes too."""

    samples: int = 192
    """Samples that are timed at a time."""


def collected(folder: Path) -> None:
    """Collects, and prints how fast."""
    moments = 0
    for town in TOWNS:
        drive_job(DriveJob(folder=folder / "warm", town=town, number=0))
    began_s = time.process_time()
    for town in TOWNS:
        for number in range(DRIVES):
            moments += drive_job(DriveJob(folder=folder / "data", town=town, number=number)).moments
    busy_s = time.process_time() - began_s
    kilobytes = sum(path.stat().st_size for path in drive_paths(folder / "data")) / 1000
    print(f"collect: {moments / busy_s:.0f} moments/s a core, {kilobytes / moments:.2f} kB each")


def rendered(samples: Samples, name: str, count: int) -> None:
    """Renders samples here, and prints how fast."""
    for number in range(count):  # towns, drives and observers are made
        samples[number]
    began_s, moments = time.process_time(), 0
    for number in range(count, 2 * count):
        moments += len(samples[number].inputs)
    busy_s = time.process_time() - began_s
    print(
        f"{name}: {count / busy_s:.0f} samples/s, {moments / busy_s:.0f} moments/s rendered a core"
    )


def loaded(samples: Samples, name: str, count: int, workers: int) -> None:
    """Renders in other processes, and prints how fast by the clock."""
    data = batches(samples, workers=workers)
    for _ in range(max(count // BATCH, 8 * workers)):
        next(data)
    began_s, moments = time.perf_counter(), 0
    for _ in range(count // BATCH):
        moments += int(next(data).begun.sum())
    busy_s = time.perf_counter() - began_s
    data.close()
    print(f"{name}: {moments / busy_s:.0f} moments/s by {workers} processes (clock)")


def trained(samples: Samples, training: Training, name: str, steps: int) -> None:
    """Trains on batches that are there already, and prints how fast."""
    data = batches(samples)
    ready = [next(data) for _ in range(steps + 1)]
    training.update(ready[0])
    began_s = time.process_time()
    for batch in ready[1:]:
        training.update(batch)
    busy_s = time.process_time() - began_s
    print(f"{name}: {steps * BATCH / busy_s:.0f} samples/s trained a core")


def planned(moments: Moments, folder: Path, name: str, steps: int) -> None:
    """Encodes moments, draws batches of them, trains a planner alone; prints how fast."""
    policy = config_named(name)
    few = moments.thinned(1000)
    cached(few, policy.grid, folder / "warm")  # towns are loaded, kernels compiled
    began_s = time.process_time()
    cache = cached(few, policy.grid, folder / "encoded")
    encoded_s = time.process_time() - began_s
    config = TrainConfig(steps=steps, batch=PLANNED, **PLANNING)
    samples = PlanningSamples.of(policy, config, cache)
    began_s = time.process_time()
    ready = [samples.batch(step, slice(0, PLANNED)) for step in range(steps + 1)]
    drawn_s = time.process_time() - began_s
    print(f"{name}, planner alone: {len(few) / encoded_s:.0f} moments/s encoded a core, ", end="")
    print(f"{(steps + 1) * PLANNED / drawn_s:.0f} samples/s drawn")
    for precision in ("float32", "bfloat16"):
        training = Training.begin(policy, replace(config, precision=precision), "cpu")
        training.update(ready[0])
        began_s = time.process_time()
        for batch in ready[1:]:
            training.update(batch)
        rate = steps * PLANNED / (time.process_time() - began_s)
        print(f"{name}, planner alone: {rate:.0f} samples/s trained a core, {precision}")


def main(benchmark: Benchmark) -> None:
    """Prints all figures."""
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        collected(Path(folder))
        moments = load_moments([Path(folder) / "data"], standing_share=0.3)
        planned(moments, Path(folder), "driveinsight", 8)
        config = TrainConfig(steps=10**6, batch=BATCH)
        for name in CONFIGS:
            policy = config_named(name)
            samples = Samples(policy, config, moments)
            rendered(samples, name, benchmark.samples)
            trained(samples, Training.begin(policy, config, "cpu"), name, 4)
            for workers in range(1, benchmark.workers + 1):
                loaded(samples, name, benchmark.samples, workers)


if __name__ == "__main__":
    main(tyro.cli(Benchmark, description=__doc__))
