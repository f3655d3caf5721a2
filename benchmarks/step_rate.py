"""How fast worlds tick and environments step, beside highway-env in the same town, on one core.

    python benchmarks/step_rate.py
    python benchmarks/step_rate.py --against ../before     two checkouts in turn

Prints medians and asserts nothing. Times are of the wall clock: other work on the machine makes
them worse and never better, so beside each median stands the best round.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from step_works import (
    SEED,
    VEHICLES,
    WALKERS,
    WARM_UP_S,
    Work,
    drive_works,
    prompt_env,
    record_drive,
)
from two_checkouts import TITLES, compare

from di_envs.numerics.kernels import cpu_capability
from di_envs.route_env import RouteEnv
from di_envs.world.state import TICK_S

PARTS = ("rate", "highway", "start")

# What a user's first lines cost: run in a process of its own.
FIRST_STEPS = """
import time
begin = time.perf_counter()
import di_envs
imported = time.perf_counter()
import gymnasium, numpy
env = gymnasium.make("DriveInsight-Town05Long-v1")
env.reset(seed=0)
for _ in range(3):
    env.step(numpy.array([0.5, 0.0, 0.0], numpy.float32))
print(imported - begin, time.perf_counter() - begin)
"""


@dataclass(frozen=True, kw_only=True)
class Times:
    """Seconds that each round took, for `count` things done in each."""

    seconds: list[float]
    count: int

    @property
    def median_s(self) -> float:
        """Of one thing."""
        return statistics.median(self.seconds) / self.count

    @property
    def best_s(self) -> float:
        """Of one thing, in the best round."""
        return min(self.seconds) / self.count

    def rates(self) -> str:
        """The cells `median | best` of a table, in things a second."""
        return f"{_number(1.0 / self.median_s)} | {_number(1.0 / self.best_s)}"


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 100.0 else f"{value:.3g}"


class Bench:
    """Shows on the terminal what is under way, and prints the results."""

    def __init__(self, rounds: int, seconds: float) -> None:
        self.rounds, self.seconds = rounds, seconds
        self._console = Console(stderr=True)

    @contextmanager
    def doing(self, what: str) -> Iterator[None]:
        """Says what takes time, with a sign of life."""
        begin = time.perf_counter()
        with self._console.status(what):
            yield
        self._console.print(f"{what}: {time.perf_counter() - begin:.1f} s", style="dim")

    def time(self, what: str, works: dict[str, Work]) -> dict[str, Times]:
        """Times rounds of each work, all in turn, so that a busy machine is unjust to none.

        Args:
            what: Said on the terminal.
            works: By name, how many things a round does, and what does them. The first round of
                each is not counted.
        """
        seconds: dict[str, list[float]] = {name: [] for name in works}
        with self.doing(what):
            for _, work in works.values():
                work()
            for _ in range(self.rounds):
                for name, (_, work) in works.items():
                    begin = time.perf_counter()
                    work()
                    seconds[name].append(time.perf_counter() - begin)
        return {
            name: Times(seconds=seconds[name], count=count) for name, (count, _) in works.items()
        }


def measure_rates(bench: Bench) -> Times:
    """World ticks and environment steps along a drive of the expert; returns those of the world."""
    with bench.doing("making an environment (compiles, if this is the first run)"):
        env = prompt_env()
        works, ticks = drive_works(env), env.config.control_ticks
    times = bench.time("world ticks and environment steps", works)
    world, steps = times["world"], times["env"]
    print(f"\n## Rates with {VEHICLES} vehicles, {WALKERS} walkers and the ego in Town05\n")
    print("| what | median a second | best round |")
    print("|---|---:|---:|")
    print(f"| world ticks of {TICK_S} s | {world.rates()} |")
    print(f"| `env.step` of {ticks} ticks, observations `prompt` | {steps.rates()} |")
    speed = env.config.control_dt_s / steps.median_s
    print(f"\n`env.step` runs at {speed:,.0f} times real time (replay of an expert's drive).")
    return world


def highway_road(bench: Bench) -> Any:
    """highway-env's `Road` with as many vehicles, on the same lanes, from the same scene."""
    with bench.doing("importing highway-env and making its road"):
        from highway_env.road.road import Road

        from di_envs.highway.conversion import to_highway_road

        env = RouteEnv(suite="town05_long", observations=("prompt",), walkers=0)
        record_drive(env, WARM_UP_S)  # leads to the scene
        scene = to_highway_road(env.view)
        road = Road(scene.network, np_random=np.random.RandomState(SEED))
        for vehicle in scene.vehicles:
            vehicle.road = road
        road.vehicles = scene.vehicles
    return road


def measure_highway(bench: Bench, world_tick: Times | None) -> None:
    """highway-env's act and step."""
    road = highway_road(bench)
    seconds: list[float] = []
    with bench.doing("highway-env's Road.act() and Road.step()"):
        until = time.perf_counter() + bench.seconds
        while time.perf_counter() < until or len(seconds) < 3:
            begin = time.perf_counter()
            road.act()
            road.step(TICK_S)
            seconds.append(time.perf_counter() - begin)
    theirs = Times(seconds=seconds, count=1)
    count = len(road.vehicles)
    lanes = len(road.network.lanes_list())
    print(f"\n## highway-env {version('highway-env')} in the same town\n")
    print("| what | median a second | best round |")
    print("|---|---:|---:|")
    print(f"| `Road.act()` + `Road.step({TICK_S})` | {theirs.rates()} |")
    print(f"\n{count} `IDMVehicle`s on {lanes} lanes, no walkers, lights or observations.")
    if world_tick is not None:
        ours = (VEHICLES + 1) / world_tick.median_s
        ratio = ours / (count / theirs.median_s)
        print(
            f"Vehicle-ticks a second, both of {TICK_S} s: {_number(ours)} here, "
            f"{_number(count / theirs.median_s)} there: {_number(ratio)} times as many."
        )


def measure_start(bench: Bench) -> None:
    """The first steps in a fresh process: with nothing compiled or parsed before, and after."""
    with tempfile.TemporaryDirectory() as folder:
        with bench.doing("cold start: compiling every kernel that an environment needs"):
            _, cold = first_steps(Path(folder))
        with bench.doing("warm starts"):
            warm = [first_steps(Path(folder)) for _ in range(3)]
    print("\n## From `python` to the third step of `DriveInsight-Town05Long-v1`\n")
    print("| start | seconds |")
    print("|---|---:|")
    print(f"| cold: kernels compiled, town parsed, once for a version and CPU | {cold:.1f} |")
    print(f"| warm, median of {len(warm)} | {statistics.median(whole for _, whole in warm):.2f} |")
    print(f"| of which `import di_envs` | {statistics.median(own for own, _ in warm):.2f} |")


def first_steps(cache: Path) -> tuple[float, float]:
    """Seconds of the import, and of all, in a process that keeps its caches in a folder."""
    places = {"XDG_CACHE_HOME": str(cache), "HOME": str(cache), "LOCALAPPDATA": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", FIRST_STEPS],
        env={**os.environ, **places},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        sys.exit(f"the first steps failed in a process of their own:\n{done.stderr}")
    imported, everything = done.stdout.split()
    return float(imported), float(everything)


def main() -> None:
    """Measures the parts asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="default: all")
    parser.add_argument("--rounds", type=int, default=9, help="timed rounds (default: 9)")
    parser.add_argument(
        "--highway-seconds", type=float, default=20.0, help="for highway-env (default: 20)"
    )
    parser.add_argument(
        "--against",
        type=Path,
        metavar="FOLDER",
        help="instead of the parts: the checkout in this folder and this one, in turn",
    )
    parser.add_argument(
        "--works", nargs="+", choices=TITLES, default=list(TITLES), help="for --against: only these"
    )
    arguments = parser.parse_args()
    if arguments.rounds < 1:
        parser.error("--rounds must be at least 1")
    if arguments.against is not None and not (arguments.against / "di_envs").is_dir():
        parser.error(f"--against: expected a checkout, with a folder di_envs: {arguments.against}")
    bench = Bench(arguments.rounds, arguments.highway_seconds)
    load = (
        f"; load average {os.getloadavg()[0]:.1f} at the start" if hasattr(os, "getloadavg") else ""
    )
    print(f"{platform.system()}, CPU {cpu_capability()}, {os.cpu_count()} cores{load}.")
    print(f"Python {platform.python_version()}, numba {version('numba')}, numpy {np.__version__}.")
    if arguments.against is not None:
        compare(arguments.against.resolve(), arguments.rounds, arguments.works)
        return
    rate = measure_rates(bench) if "rate" in arguments.parts else None
    if "highway" in arguments.parts:
        measure_highway(bench, rate)
    if "start" in arguments.parts:
        measure_start(bench)


if __name__ == "__main__":
    main()
