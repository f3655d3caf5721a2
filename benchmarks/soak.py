"""Drives long with every sensor in random weathers, and looks for leaks, NaN and stray values.

    python benchmarks/soak.py                                # 20,000 steps of town05_long
    python benchmarks/soak.py --steps 2000 --suite toy

The expert drives one episode after another, each on a route and in a weather of its own, with the
small cameras (RGB, depth, semantic and instance), the LiDAR, prompts and the inertial sensors.
Every observation is held against its space. Ends with 1 if memory has grown by more than
`--limit-mb`, or if an observation lay outside; so a machine can run it too.
"""

from __future__ import annotations

import argparse
import dataclasses
import gc
import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track

from agents import load_agent
from di_envs.config import OBSERVATION_GROUPS
from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.route_env import RouteEnv
from di_envs.sensors.camera.config import RIGS
from di_envs.sensors.lidar.config import LIDARS
from di_envs.sensors.weather import PRESETS

EPISODE_STEPS = 300  # at most, so that many weathers are seen
WARM_UP_STEPS = 1000  # or a quarter: after so many, memory is looked at for the first time
MB = 2**20


@dataclass(frozen=True, kw_only=True)
class Soaked:
    """What a soak found.

    Attributes:
        steps: How many were driven, over all episodes.
        episodes: How many were begun.
        weathers: In which they were driven.
        faults: What was wrong with an observation, in words; empty if nothing was.
        memory_mb: Resident memory after the warm-up, then ten times until the end.
        cpu_s: Processor time of all of it.
    """

    steps: int
    episodes: int
    weathers: frozenset[str]
    faults: tuple[str, ...]
    memory_mb: tuple[float, ...]
    cpu_s: float

    @property
    def growth_mb(self) -> float:
        """How much more memory is in use at the end than after the warm-up."""
        return self.memory_mb[-1] - self.memory_mb[0]


def all_sensors(suite: str, weather: str) -> RouteEnv:
    """An environment that shows everything there is to see, in one weather."""
    rig = dataclasses.replace(RIGS["small"], depth=True, semantic=True, instance=True)
    lidar = dataclasses.replace(LIDARS["paper"], semantic=True, noise_m=0.02)
    return RouteEnv(
        suite=suite, observations=OBSERVATION_GROUPS, cameras=rig, lidar=lidar, weather=weather
    )


def soak(
    make: Callable[[str], Any], steps: int, *, seed: int = 0, counted: Callable[..., Any] = iter
) -> Soaked:
    """Drives so many steps with the expert, in an environment an episode.

    Args:
        make: Gives an environment that sees a weather.
        steps: How many to drive, over all episodes.
        seed: Of the first episode; each has the next, and draws its weather by it.
        counted: Goes through the numbers of the steps; shows progress to people.
    """
    begin = time.process_time()
    ride = _ride(make, seed)
    warm = min(WARM_UP_STEPS, steps // 4)
    looks = {warm + round(k * (steps - warm) / 10) for k in range(11)}
    memory, faults, weathers, episodes = [], [], set(), 0
    for step in counted(range(1, steps + 1)):
        weather, begun, space, observation = next(ride)
        weathers.add(weather)
        episodes += begun
        if fault := fault_of(space, observation):
            faults.append(f"step {step}, {weather}: {fault}")
        if step in looks:
            memory.append(resident_mb())
    return Soaked(
        steps=steps,
        episodes=episodes,
        weathers=frozenset(weathers),
        faults=tuple(faults),
        memory_mb=tuple(memory),
        cpu_s=time.process_time() - begin,
    )


def _ride(make: Callable[[str], Any], seed: int) -> Iterator[tuple[str, bool, Any, Any]]:
    """Steps without an end: weather, whether an episode has begun, space, observation."""
    names = tuple(PRESETS)
    while True:
        weather = names[int(uniform(seed, int(Stream.AGENT), 0, 0) * len(names))]
        env = make(weather)  # a new one each time: they too must give back what they held
        observation, _ = env.reset(seed=seed)
        agent = load_agent("expert")
        memory = agent.start(env.unwrapped.plan, seed)
        for step in range(EPISODE_STEPS):
            seen = {**observation, "world": env.unwrapped.view}
            control, memory = agent.act(seen, memory)
            observation, _, terminated, truncated, _ = env.step(control)
            yield weather, step == 0, env.observation_space, observation
            if terminated or truncated:
                break
        env.close()
        seed += 1


def fault_of(space: Any, observation: dict[str, Any]) -> str:
    """What is wrong with an observation: keys, NaN, values outside their space; else nothing."""
    if observation.keys() != space.spaces.keys():
        return f"keys {sorted(observation)} are not those of the space"
    for name, value in observation.items():
        if not np.isfinite(value).all():
            return f"'{name}' holds NaN or infinity"
        if value not in space[name]:
            return f"'{name}' is not in its space"
    return ""


def resident_mb() -> float:
    """Memory that this process holds now, in MB; of Linux."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MB


def main() -> int:
    """Soaks, says what was found, and returns the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--suite", default="town05_long")
    parser.add_argument("--seed", type=int, default=0, help="of the first episode")
    parser.add_argument("--limit-mb", type=float, default=20.0, help="how much memory may grow")
    options = parser.parse_args()
    console = Console()
    found = soak(
        lambda weather: all_sensors(options.suite, weather),
        options.steps,
        seed=options.seed,
        counted=lambda steps: track(steps, "soaking", console=console),
    )
    console.print(
        f"{found.steps:,} steps in {found.episodes} episodes and {len(found.weathers)} weathers, "
        f"{found.cpu_s:.0f} s of processor time ({found.steps / found.cpu_s:.0f} steps/s)"
    )
    console.print("memory [MB]: " + " ".join(f"{mb:.1f}" for mb in found.memory_mb))
    console.print(f"growth {found.growth_mb:+.1f} MB; allowed {options.limit_mb:.1f}")
    for fault in found.faults[:20]:
        console.print(fault, style="red")
    console.print(f"{len(found.faults)} observations outside their spaces or with NaN")
    return int(bool(found.faults) or found.growth_mb > options.limit_mb)


if __name__ == "__main__":
    sys.exit(main())
