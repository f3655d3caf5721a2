"""Which planner learns best: variants trained on the same moments, as many samples or as long.

python benchmarks/planners.py --data data --samples 100000     the same samples for each
python benchmarks/planners.py --data data --seconds 120        the same CPU time for each

Prints a row for each: what it learns a second on one core, and its waypoint loss on drives kept out
of training, given all and without components. CPU time counts, so other work on the machine
disturbs little. With `--seconds` a few steps are timed first, and the steps are what fits.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import torch
import tyro

from agents.driveinsight.config import PlannerConfig, PolicyConfig, config_named
from agents.training.caching import MomentCache, cached
from agents.training.config import PLANNING, TrainConfig
from agents.training.learning import Training
from agents.training.moments import load_moments
from agents.training.planning import PlanningSamples

VARIANTS: Mapping[str, PlannerConfig] = MappingProxyType(
    {
        "a token a component, the ego's query": PlannerConfig(),
        "a token a component and what comes next, the ego's query": PlannerConfig(next_row=True),
        "a token a component, a query a waypoint": PlannerConfig(each_waypoint=True),
        "a token a row, the ego's query": PlannerConfig(each_row=True),
        "a token a row, a query a waypoint": PlannerConfig(each_row=True, each_waypoint=True),
        "a token a row, two layers of self-attention, a query a waypoint": PlannerConfig(
            each_row=True, each_waypoint=True, mixing_layers=2
        ),
    }
)
TIMED_STEPS = 20


@dataclass(frozen=True, kw_only=True)
class Study:
    """What is compared."""

    data: tuple[Path, ...] = (Path("data"),)
    """Folders of drives."""

    cache: Path = Path("cache")
    """Where moments are kept encoded."""

    samples: int = 100_000
    """That each variant learns from."""

    seconds: float | None = None
    """Of CPU time that each variant learns for, instead."""

    batch: int = 128
    seed: int = 0
    precision: str = "float32"

    only: tuple[int, ...] = ()
    """Numbers of variants; () for all."""


def trained(
    policy: PolicyConfig, config: TrainConfig, cache: MomentCache, steps: int
) -> tuple[Training, float]:
    """A training after so many steps, and the CPU time that they took [s]."""
    samples = PlanningSamples.of(policy, config, cache)
    training = Training.begin(policy, config, "cpu")
    began_s = time.process_time()
    for step in range(steps):
        training.update(samples.batch(step, slice(0, config.batch)))
    return training, time.process_time() - began_s


def row_of(name: str, planner: PlannerConfig, study: Study, cache: MomentCache) -> str:
    """A row of the table."""
    policy = dataclasses.replace(config_named("driveinsight"), planner=planner)
    config = TrainConfig(
        steps=-(-study.samples // study.batch),
        batch=study.batch,
        seed=study.seed,
        held_out=0.05,
        precision=study.precision,
        **{**PLANNING, "measured_moments": 2048},
    )
    if study.seconds is not None:
        _, took_s = trained(policy, config, cache, TIMED_STEPS)
        config = dataclasses.replace(config, steps=int(TIMED_STEPS * study.seconds / took_s))
    training, took_s = trained(policy, config, cache, config.steps)
    samples = PlanningSamples.of(policy, config, cache)
    looks = (samples.measured(n, slice(0, config.batch)) for n in range(10**6))
    found = training.measure(looks)
    seen = config.steps * config.batch
    losses = " | ".join(f"{value:.3f}" for value in found.values())
    return f"| {name} | {seen:,} | {seen / took_s:.0f} | {losses} |"


def main(study: Study) -> None:
    """Prints the table."""
    torch.set_num_threads(1)
    moments = load_moments(study.data, standing_share=TrainConfig().standing_share)
    cache = cached(moments, config_named("driveinsight").grid, study.cache)
    columns = [name.removeprefix("held_out ") for name in TrainConfig(**PLANNING).measures]
    head = ["planner", "samples", "samples/s", *["all given", *columns[1:]]]
    print(f"{len(moments)} moments\n\n| {' | '.join(head)} |\n|{'---|' * len(head)}", flush=True)
    for number, (name, planner) in enumerate(VARIANTS.items()):
        if not study.only or number in study.only:
            print(row_of(name, planner, study, cache), flush=True)


if __name__ == "__main__":
    main(tyro.cli(Study, description=__doc__))
