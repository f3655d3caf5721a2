"""How much many worlds in one process gain by threads, beside one environment alone.

    python benchmarks/vector_rate.py

Prints rates and asserts nothing. Times are of the wall clock, so other work on the machine hides
what threads gain: `cores` says how many were at work, and rounds with fewer than there are threads
say little.
"""

from __future__ import annotations

import argparse
import statistics
import time
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from rich.console import Console
from rich.table import Table

import di_envs  # noqa: F401 (registers the ids)
from di_envs.kernels import cpu_capability

GROUPS = {"prompt": ("prompt",), "prompt and cameras": ("prompt", "camera")}
ROUND_STEPS = {"prompt": 1600, "prompt and cameras": 96}  # of all worlds together
CONTROL = np.array([0.0, 0.0, 1.0], np.float32)  # stands, so that no world ends


@dataclass(frozen=True, kw_only=True)
class Round:
    """One timing."""

    steps_per_s: float
    cores: float


def timed(env: Any, action: Any, times: int, worlds: int) -> Round:
    """Steps some worlds so often, from the start of their episodes."""
    env.reset(seed=0)
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(times):
        env.step(action)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return Round(steps_per_s=times * worlds / wall, cores=cpu / wall)


def measure(groups: str, env_id: str, worlds: int, rounds: int) -> Table:
    """One environment and many worlds, taking turns."""
    options = {"observations": GROUPS[groups]}
    made: dict[str, tuple[Any, Any, int]] = {}  # environment, action, worlds
    single = gymnasium.make(env_id, **options).unwrapped
    made["one environment"] = single, CONTROL, 1
    for threads in (1, 2):
        many = gymnasium.make_vec(env_id, num_envs=worlds, threads=threads, **options)
        name = f"{worlds} worlds, {threads} thread{'s' if threads > 1 else ''}"
        made[name] = many, np.tile(CONTROL, (worlds, 1)), worlds
    results: dict[str, list[Round]] = {name: [] for name in made}
    for _ in range(rounds + 1):
        for name, (env, action, count) in made.items():
            results[name].append(timed(env, action, ROUND_STEPS[groups] // count, count))
    table = Table("", "steps/s, median", "best", "of one (best)", "cores", title=groups)
    alone = max(result.steps_per_s for result in results["one environment"][1:])
    for name, found in results.items():
        rates = [result.steps_per_s for result in found[1:]]  # the first round warms up
        cores = max(result.cores for result in found[1:])
        row = f"{statistics.median(rates):.0f}", f"{max(rates):.0f}", f"{max(rates) / alone:.2f}"
        table.add_row(name, *row, f"{cores:.2f}")
    return table


def main() -> None:
    """Measures each group of observations."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--env", default="DriveInsight-Town05Long-v0")
    parser.add_argument("--worlds", type=int, default=16)
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    console = Console()
    console.print(f"CPU {cpu_capability()}")
    for groups in GROUPS:
        console.print(measure(groups, arguments.env, arguments.worlds, arguments.rounds))


if __name__ == "__main__":
    main()
