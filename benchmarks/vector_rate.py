"""How much many worlds in one process gain by threads, beside one environment alone.

    python benchmarks/vector_rate.py

Prints rates and asserts nothing. All rows drive the same episodes, those of seeds from 0 on, and
are timed over the same steps of each: traffic costs more where it moves than once it waits behind
an ego that stands, so a long episode is no measure of many short ones. One environment drives
them one after the other. Rates are by the wall clock, so other work on the machine hides what
threads gain: `cores` says how many were at work, and rounds with fewer than there are threads say
little. `of one` is the median of the rounds' ratios to one environment, over the same episodes in
the same round. `CPU us` is processor time a step of one world, `alone` the part of it that one
thread does while the others wait; `could be` is what these times allow, likewise by rounds: that
of one environment by (alone + the rest / threads). The row `two processes` is of one environment
in each of two processes that share nothing and the episodes between them: no threads of one
process can gain more on this machine.
"""

from __future__ import annotations

import argparse
import itertools
import multiprocessing
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import gymnasium
import numpy as np
from rich.console import Console
from rich.table import Table

import di_envs  # noqa: F401 (registers the ids)
from di_envs.bulk.threads import Crew
from di_envs.numerics.kernels import cpu_capability
from di_envs.vector_env import RouteVectorEnv

GROUPS = {"prompt": ("prompt",), "camera, lidar, prompt": ("camera", "lidar", "prompt")}
APART = "two processes"
STEPS = {"prompt": 96, "camera, lidar, prompt": 8}  # of each episode that are timed, in a row
FIRST = 4  # steps of each that are not: what they meet has just been made
CONTROL = np.array([0.0, 0.0, 1.0], np.float32)  # stands, so that no world ends


@dataclass(frozen=True, kw_only=True)
class Round:
    """One timing."""

    steps_per_s: float
    cores: float
    cpu_us: float
    alone_us: float

    def bound_us(self, threads: int) -> float:
        """What a step would take if each thread had a core to itself."""
        return self.alone_us + (self.cpu_us - self.alone_us) / threads


class Clocked(Crew):
    """Knows how much processor time is spent on what its threads share."""

    shared_s = 0.0

    def each(self, jobs: Sequence[Callable[[], None]]) -> None:
        """Does all jobs by the clock."""
        begin = time.process_time()
        super().each(jobs)
        self.shared_s += time.process_time() - begin


class ClockedWorlds(RouteVectorEnv):
    """Many worlds whose threads are clocked."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._crew = Clocked(self.threads)

    @property
    def crew(self) -> Clocked:
        """The threads."""
        return self._crew


class Apart:
    """One environment in each of two processes, at work at the same time."""

    def __init__(self, env_id: str, groups: str) -> None:
        context = multiprocessing.get_context("spawn")
        self._ends = []
        for _ in range(2):
            ours, theirs = context.Pipe()
            context.Process(target=_serve, args=(theirs, env_id, groups), daemon=True).start()
            self._ends.append(ours)

    def timed(self, episodes: int) -> Round:
        """Drives so many episodes, half of them in each; the rate is of both together."""
        for first, end in enumerate(self._ends):
            end.send(range(first, episodes, len(self._ends)))
        found = [together(end.recv()) for end in self._ends]
        return Round(
            steps_per_s=sum(own.steps_per_s for own in found),
            cores=sum(own.cores for own in found),
            cpu_us=statistics.fmean(own.cpu_us for own in found),
            alone_us=0.0,
        )

    def close(self) -> None:
        """Ends both."""
        for end in self._ends:
            end.send(None)


def _serve(end: Connection, env_id: str, groups: str) -> None:
    env = gymnasium.make(env_id, observations=GROUPS[groups]).unwrapped
    while (seeds := end.recv()) is not None:
        end.send([timed(env, CONTROL, STEPS[groups], 1, seed) for seed in seeds])


def timed(env: Any, action: Any, steps: int, worlds: int, seed: int) -> Round:
    """Steps some worlds so often, a little after the start of their episodes."""
    env.reset(seed=seed)
    crew = env.crew if isinstance(env, ClockedWorlds) else Clocked(1)
    for _ in range(FIRST):
        env.step(action)
    crew.shared_s = 0.0
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(steps):
        env.step(action)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    count = steps * worlds
    return Round(
        steps_per_s=count / wall,
        cores=cpu / wall,
        cpu_us=1e6 * cpu / count,
        alone_us=1e6 * (cpu - crew.shared_s) / count,
    )


def together(episodes: Sequence[Round]) -> Round:
    """Of as many steps each, one after the other."""
    wall_us = [1e6 / own.steps_per_s for own in episodes]
    cpu_us = statistics.fmean(own.cpu_us for own in episodes)
    return Round(
        steps_per_s=1e6 / statistics.fmean(wall_us),
        cores=cpu_us / statistics.fmean(wall_us),
        cpu_us=cpu_us,
        alone_us=statistics.fmean(own.alone_us for own in episodes),
    )


def measure(groups: str, env_id: str, numbers: Sequence[int], rounds: int) -> Table:
    """One environment and many worlds, taking turns."""
    options = {"observations": GROUPS[groups]}
    given = {**gymnasium.spec(env_id).kwargs, **options}
    one, apart = gymnasium.make(env_id, **options).unwrapped, Apart(env_id, groups)
    made = {
        (worlds, threads): ClockedWorlds(worlds, threads=threads, **given)
        for worlds, threads in itertools.product(numbers, (1, 2))
    }
    steps, most = STEPS[groups], max(numbers)
    alone: dict[int, list[Round]] = {worlds: [] for worlds in numbers}
    results: dict[str, tuple[int, int, list[Round]]] = {}  # worlds, threads
    for _ in range(rounds + 1):
        episodes = [timed(one, CONTROL, steps, 1, seed) for seed in range(most)]
        for worlds in numbers:
            own = together(episodes[:worlds])
            alone[worlds].append(own)
            _add(results, f"one environment, {worlds} episodes", worlds, 1, own)
        _add(results, f"{APART}, {most} episodes", most, 2, apart.timed(most))
        for (worlds, threads), many in made.items():
            actions = np.tile(CONTROL, (worlds, 1))
            name = f"{worlds} worlds, {threads} thread{'s' if threads > 1 else ''}"
            _add(results, name, worlds, threads, timed(many, actions, steps, worlds, 0))
    for env in (one, apart, *made.values()):
        env.close()
    columns = ("", "steps/s", "best", "of one", "cores", "CPU us", "alone", "could be")
    table = Table(*columns, title=groups)
    for name, (worlds, threads, found) in results.items():
        table.add_row(name, *cells(found[1:], alone[worlds][1:], threads))  # the first warms up
    return table


def _add(
    results: dict[str, tuple[int, int, list[Round]]],
    name: str,
    worlds: int,
    threads: int,
    own: Round,
) -> None:
    results.setdefault(name, (worlds, threads, []))[2].append(own)


def cells(found: Sequence[Round], alone: Sequence[Round], threads: int) -> tuple[str, ...]:
    """Medians of rounds, and of their ratios to those of one environment, round by round."""
    median, pairs = statistics.median, list(zip(found, alone, strict=True))
    return (
        f"{median(own.steps_per_s for own in found):.0f}",
        f"{max(own.steps_per_s for own in found):.0f}",
        f"{median(own.steps_per_s / one.steps_per_s for own, one in pairs):.2f}",
        f"{max(own.cores for own in found):.2f}",
        f"{median(own.cpu_us for own in found):.0f}",
        f"{median(own.alone_us for own in found):.0f}" if threads > 1 else "",
        f"{median(one.cpu_us / own.bound_us(threads) for own, one in pairs):.2f}",
    )


def main() -> None:
    """Measures each group of observations."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--env", default="DriveInsight-Town05Long-v1")
    parser.add_argument("--worlds", type=int, nargs="+", default=[16, 64])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--groups", nargs="+", choices=list(GROUPS), default=list(GROUPS))
    arguments = parser.parse_args()
    console = Console()
    console.print(f"CPU {cpu_capability()}")
    for groups in arguments.groups:
        console.print(measure(groups, arguments.env, arguments.worlds, arguments.rounds))


if __name__ == "__main__":
    main()
