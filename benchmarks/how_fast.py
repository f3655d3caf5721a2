"""The table "How fast" of the README, all of it from one run of some five minutes.

    python benchmarks/how_fast.py

What one core does takes turns, round by round, and is timed by the processor; two threads, two
workers and starts go by the clock, so the machine should do nothing else. Prints medians and
asserts nothing.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from step_rate import Bench, first_steps, highway_road
from step_works import SEED, STAND, VEHICLES, WALKERS, drive_works, prompt_env

from di_envs.numerics.kernels import cpu_capability
from di_envs.route_env import RouteEnv
from di_envs.vector_env import RouteVectorEnv
from di_envs.world.state import TICK_S

WORLDS, THREADS, LOOKS = 16, 2, 8
CAMERA_STEPS = 60
EVALUATE = ("evaluate", "--agent", "expert", "--suite", "town05_long", "--workers", "2")
Timed = Callable[[], float]  # does one round, and says how many it did a second


def alone(count: int, work: Callable[[], Any]) -> Timed:
    """Rounds of what one core does, by processor time."""

    def timed() -> float:
        begin = time.process_time()
        work()
        return count / (time.process_time() - begin)

    return timed


def with_cameras() -> Timed:
    """Steps of one environment with the small cameras alone."""
    env = RouteEnv(suite="town05_long", observations=("camera",), traffic=VEHICLES, walkers=WALKERS)
    env.reset(seed=SEED, options={"route": 0})

    def work() -> None:
        for _ in range(CAMERA_STEPS):
            env.step(STAND)

    return alone(CAMERA_STEPS, work)


def in_threads() -> Timed:
    """The same of many worlds in two threads, by the clock."""
    options: dict[str, Any] = {"traffic": VEHICLES, "walkers": WALKERS, "suite": "town05_long"}
    env = RouteVectorEnv(WORLDS, threads=THREADS, observations=("camera",), **options)
    env.reset(seed=SEED)
    action = np.tile(STAND, (WORLDS, 1))

    def timed() -> float:
        begin = time.perf_counter()
        for _ in range(LOOKS):
            env.step(action)
        return WORLDS * LOOKS / (time.perf_counter() - begin)

    return timed


def evaluated_s() -> float:
    """Seconds of an evaluation by two processes."""
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "leaderboard", *EVALUATE, "--output", f"{folder}/run"],
            check=True,
            capture_output=True,
        )
        return time.perf_counter() - begin


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=9, help="timed rounds (default: 9)")
    rounds = parser.parse_args().rounds
    if rounds < 1:
        parser.error(f"--rounds must be at least 1, not {rounds}")
    bench, console = Bench(rounds, 0.0), Console(stderr=True)
    with bench.doing("making environments"):
        drive = drive_works(prompt_env())
        road = highway_road(bench)
    works: dict[str, Timed] = {
        "`env.step` (0.1 s of driving), prompts alone, one core": alone(*drive["env"]),
        "the same with four cameras of 256 x 144": with_cameras(),
        "… in sixteen worlds, two threads": in_threads(),
        "world ticks (0.05 s), one core": alone(*drive["world"]),
        "highway-env, `Road.act()` + `step()`, as many of its vehicles on the same lanes": alone(
            1, lambda: (road.act(), road.step(TICK_S))
        ),
    }
    rates: dict[str, list[float]] = {name: [] for name in works}
    for number in track(range(rounds + 1), "rates", console=console, transient=True):
        for name, timed in works.items():
            rate = timed()
            if number:
                rates[name].append(rate)
    with tempfile.TemporaryDirectory() as folder, bench.doing("starts"):
        _, cold_s = first_steps(Path(folder))
        warm_s = statistics.median(first_steps(Path(folder))[1] for _ in range(3))
    with bench.doing("an evaluation"):
        drive_s = evaluated_s()
    print(f"CPU {cpu_capability()}\n\n| what | measured |\n|---|---:|")
    for name, found in rates.items():
        rate = statistics.median(found)
        print(
            f"| {name} | {rate:,.0f} a second |"
            if rate >= 10
            else f"| {name} | {rate:.2g} a second |"
        )
    drives = f"`driveinsight {' '.join(EVALUATE)}`: ten routes, 13 km, scenarios on"
    print(f"| {drives} | {drive_s:.0f} s |")
    print(f"| first run: compile the kernels, parse the town, three steps | {cold_s:.0f} s, once |")
    print(f"| the same from then on | {warm_s:.1f} s |")


if __name__ == "__main__":
    main()
