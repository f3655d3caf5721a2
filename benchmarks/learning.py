"""What a step of learning costs, and where it goes; how fast PPO trains; several egos in a world.

    python benchmarks/learning.py
    python benchmarks/learning.py --parts profile         needs no quiet machine

Prints tables and asserts nothing.

**profile**: PPO of Stable-Baselines3 as in `examples/train_ppo.py`, one thread, by processor time:
microseconds of each part for a decision of one world, after a first rollout that is not counted.
**rate**: decisions a second of that and of `examples/ppo_single_file.py`, as long as they train, by
the clock, on as many threads as `--threads` says: other work on the machine makes it worse.
**egos**: several egos in one world, each with a route of its own, all driving off: agent-steps a
second, by processor time, and what one more ego costs.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from random_routes import random_routes
from rich.console import Console
from rich.table import Table
from stable_baselines3.common.callbacks import BaseCallback

import di_envs
from di_envs.numerics.kernels import cpu_capability
from di_envs.town.loading import load_town
from di_envs.town.routing.remarks import RouteWarning
from di_envs.town.routing.road_graph import build_road_graph
from di_envs.town.routing.routes import write_routes

sys.path.append(str(Path(__file__).resolve().parents[1] / "examples"))

import ppo_single_file
import train_ppo

PARTS = ("profile", "rate", "egos")
EGOS = (2, 8, 32, 120)
EGO_STEPS = 20  # of 0.1 s in a round, from the start of an episode
ROLLOUTS = 4  # that are timed
# Of a decision; each is taken off the one that it is a part of
STAGES = (
    "worlds: the kernel",
    "worlds: resets",
    "worlds: vectors",
    "worlds: the rest",
    "policy",
    "update",
    "the rest",
)


class Stopwatch:
    """Processor time of functions, by name, each without the others that it calls."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._within: list[str] = []

    def watch(self, owner: Any, name: str, stage: str) -> None:
        """Has a method of one object timed from now on."""
        method = getattr(owner, name)

        def timed(*arguments: Any, **options: Any) -> Any:
            with self.doing(stage):
                return method(*arguments, **options)

        setattr(owner, name, timed)

    @contextmanager
    def doing(self, stage: str) -> Iterator[None]:
        """Times what is done within."""
        begin = time.process_time()
        self._within.append(stage)
        yield
        taken = time.process_time() - begin
        self._within.pop()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + taken
        if self._within:
            self.seconds[self._within[-1]] = self.seconds.get(self._within[-1], 0.0) - taken


class NoSteps(BaseCallback):
    """Does nothing."""

    def _on_step(self) -> bool:
        return True


def sb3_learner(folder: Path, threads: int) -> tuple[Any, Any, train_ppo.Training]:
    """The example's learner and its worlds, after a first rollout."""
    training = train_ppo.Training(model=folder / "ppo.zip", threads=threads)
    torch.set_num_threads(threads)
    worlds = train_ppo.make_worlds(training)
    learner = train_ppo.make_learner(worlds, training)
    learner.learn(training.rollout, callback=NoSteps())
    return learner, worlds, training


def profile(folder: Path) -> Table:
    """Where the time of a decision goes."""
    learner, worlds, training = sb3_learner(folder, 1)
    envs: Any = worlds.venv.venv.envs.unwrapped
    watch = Stopwatch()
    watch.watch(envs, "step", "worlds: the rest")
    watch.watch(envs._worlds, "run", "worlds: the kernel")
    watch.watch(envs._form, "of", "worlds: vectors")
    for env in envs.envs:
        watch.watch(env, "begin", "worlds: resets")
    watch.watch(learner.policy, "forward", "policy")
    watch.watch(learner, "train", "update")
    decisions = ROLLOUTS * training.rollout
    with watch.doing("the rest"):
        learner.learn(decisions, callback=NoSteps())
    whole = sum(watch.seconds.values())
    table = Table("part", "us a decision", "share", title=f"{training.worlds} worlds, one thread")
    for stage in STAGES:
        own = watch.seconds[stage]
        table.add_row(stage, f"{1e6 * own / decisions:.0f}", f"{100.0 * own / whole:.0f} %")
    table.add_row("all", f"{1e6 * whole / decisions:.0f}", "100 %")
    worlds.close()
    return table


def rates(folder: Path, threads: int) -> Table:
    """Decisions a second while both examples train."""
    table = Table("trainer", "worlds", "decision [s]", "decisions/s", "ticks/s", "cores")
    learner, worlds, training = sb3_learner(folder, threads)
    wall, cpu = time.perf_counter(), time.process_time()
    learner.learn(ROLLOUTS * training.rollout, callback=NoSteps())
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    rate = ROLLOUTS * training.rollout / wall
    table.add_row(*row("Stable-Baselines3, town05_tiny", training.worlds, 0.2, rate, cpu / wall))
    worlds.close()
    chosen = (
        ("one file, town05_tiny", "DriveInsight-Town05Tiny-v1", 0.2),
        ("one file, town05_tiny", "DriveInsight-Town05Tiny-v1", 0.1),
        ("one file, toy", "DriveInsight-Toy-v1", 0.2),
        ("one file, toy", "DriveInsight-Toy-v1", 0.1),
    )
    for name, env, held_s in chosen:
        options = {"env": env, "control_dt_s": held_s, "threads": threads}
        ppo_single_file.train(ppo_single_file.Training(steps=4096, **options))
        cpu = time.process_time()
        own = ppo_single_file.Training(steps=ROLLOUTS * 8192, **options)
        _, told = ppo_single_file.train(own)
        cores = (time.process_time() - cpu) / sum(told.seconds.values())
        table.add_row(*row(name, own.worlds, held_s, told.rate, cores))
    return table


def row(name: str, worlds: int, held_s: float, rate: float, cores: float) -> tuple[str, ...]:
    """The cells of a trainer."""
    ticks = rate * round(held_s / 0.05)
    return name, f"{worlds}", f"{held_s}", f"{rate:,.0f}", f"{ticks:,.0f}", f"{cores:.2f}"


def several_egos(folder: Path, rounds: int) -> Table:
    """What a step of several egos in one world costs."""
    file = folder / "many.xml"
    town = load_town("town05")
    write_routes(file, random_routes(build_road_graph(town), 2 * EGOS[-1], 7, 100.0, 600.0))
    given: dict[str, Any] = {"town": "town05", "routes": str(file), "preset": "flat"}
    given |= {"observations": ("prompt",), "traffic": 120, "walkers": 60}
    works: dict[int, Callable[[], float]] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RouteWarning)  # they go a long way round: no matter here
        for egos in EGOS:
            works[egos] = driving_off(di_envs.parallel_env(egos, **given))
    times: dict[int, list[float]] = {egos: [] for egos in EGOS}
    for k in range(rounds + 1):
        for egos, work in works.items():
            times[egos] += [work()] if k else (work(), [])[1]
    columns = ("egos", "us a step", "agent-steps/s", "us an ego", "us one more ego")
    table = Table(*columns, title="120 vehicles, 60 walkers, steps of 0.1 s")
    before = 0, 0.0
    for egos, found in times.items():
        step_us = 1e6 * statistics.median(found)
        more = (step_us - before[1]) / (egos - before[0])
        rate, each = 1e6 * egos / step_us, step_us / egos
        marginal = f"{more:.0f}" if before[0] else ""
        table.add_row(f"{egos}", f"{step_us:.0f}", f"{rate:,.0f}", f"{each:.0f}", marginal)
        before = egos, step_us
    return table


def driving_off(env: Any) -> Callable[[], float]:
    """A round of steps with all egos at light throttle: processor seconds of one step."""
    action = np.array([0.4, 0.0, 0.0], np.float32)

    def work() -> float:
        env.reset(seed=0)
        begin, steps = time.process_time(), 0
        while steps < EGO_STEPS and env.agents:
            env.step(dict.fromkeys(env.agents, action))
            steps += 1
        return (time.process_time() - begin) / steps

    return work


def main() -> None:
    """Measures the parts asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=7, help="of several egos (default: 7)")
    options = parser.parse_args()
    console = Console()
    console.print(f"CPU {cpu_capability()}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if "profile" in options.parts:
            console.print(profile(folder))
        if "rate" in options.parts:
            console.print(rates(folder, options.threads))
        if "egos" in options.parts:
            console.print(several_egos(folder, options.rounds))


if __name__ == "__main__":
    main()
