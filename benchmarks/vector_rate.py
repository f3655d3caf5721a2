"""How much many worlds in one process gain by threads, beside one environment alone.

    python benchmarks/vector_rate.py

Prints rates and asserts nothing. Rates are by the wall clock, so other work on the machine hides
what threads gain: `cores` says how many were at work, and rounds with fewer than there are threads
say little. `CPU us` is processor time a step of one world, `alone` the part of it that one thread
does while the others wait; `could be` is what these times allow: those of one environment by
(alone + the rest / threads).
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from rich.console import Console
from rich.table import Table

import di_envs  # noqa: F401 (registers the ids)
from di_envs.numerics.kernels import cpu_capability
from di_envs.vector_env import RouteVectorEnv

GROUPS = {"prompt": ("prompt",), "camera, lidar, prompt": ("camera", "lidar", "prompt")}
ROUND_STEPS = {"prompt": 1600, "camera, lidar, prompt": 96}  # of all worlds together
CONTROL = np.array([0.0, 0.0, 1.0], np.float32)  # stands, so that no world ends


@dataclass(frozen=True, kw_only=True)
class Round:
    """One timing."""

    steps_per_s: float
    cores: float
    cpu_us: float
    alone_us: float


class Clocked(RouteVectorEnv):
    """Knows how much processor time is spent on what its threads share."""

    shared_s = 0.0

    def _each(self, indices: Iterable[int], work: Callable[[int], None]) -> None:
        begin = time.process_time()
        super()._each(indices, work)
        self.shared_s += time.process_time() - begin


def timed(env: Any, action: Any, times: int, worlds: int) -> Round:
    """Steps some worlds so often, from the start of their episodes."""
    env.reset(seed=0)
    env.shared_s = 0.0
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(times):
        env.step(action)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    steps = times * worlds
    return Round(
        steps_per_s=steps / wall,
        cores=cpu / wall,
        cpu_us=1e6 * cpu / steps,
        alone_us=1e6 * (cpu - env.shared_s) / steps,
    )


def measure(groups: str, env_id: str, worlds: int, rounds: int) -> Table:
    """One environment and many worlds, taking turns."""
    options = {"observations": GROUPS[groups]}
    made: dict[str, tuple[Any, Any, int]] = {}  # environment, action, worlds
    threads_of = {"one environment": 1}
    single = gymnasium.make(env_id, **options).unwrapped
    made["one environment"] = single, CONTROL, 1
    for threads in (1, 2):
        many = Clocked(worlds, threads=threads, **{**gymnasium.spec(env_id).kwargs, **options})
        name = f"{worlds} worlds, {threads} thread{'s' if threads > 1 else ''}"
        made[name] = many, np.tile(CONTROL, (worlds, 1)), worlds
        threads_of[name] = threads
    results: dict[str, list[Round]] = {name: [] for name in made}
    for _ in range(rounds + 1):
        for name, (env, action, count) in made.items():
            results[name].append(timed(env, action, ROUND_STEPS[groups] // count, count))
    columns = ("", "steps/s", "best", "of one", "cores", "CPU us", "alone", "could be")
    table = Table(*columns, title=groups)
    best_alone = max(result.steps_per_s for result in results["one environment"][1:])
    one_us = statistics.median(result.cpu_us for result in results["one environment"][1:])
    for name, found in results.items():
        counted = found[1:]  # the first round warms up
        rates = [result.steps_per_s for result in counted]
        cpu_us = statistics.median(result.cpu_us for result in counted)
        alone_us = statistics.median(result.alone_us for result in counted)
        bound_us = alone_us + (cpu_us - alone_us) / threads_of[name]
        table.add_row(
            name,
            f"{statistics.median(rates):.0f}",
            f"{max(rates):.0f}",
            f"{max(rates) / best_alone:.2f}",
            f"{max(result.cores for result in counted):.2f}",
            f"{cpu_us:.0f}",
            f"{alone_us:.0f}" if threads_of[name] > 1 else "",
            f"{one_us / bound_us:.2f}",
        )
    return table


def main() -> None:
    """Measures each group of observations."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--env", default="DriveInsight-Town05Long-v1")
    parser.add_argument("--worlds", type=int, default=16)
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    console = Console()
    console.print(f"CPU {cpu_capability()}")
    for groups in GROUPS:
        console.print(measure(groups, arguments.env, arguments.worlds, arguments.rounds))


if __name__ == "__main__":
    main()
