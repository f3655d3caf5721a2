"""What it costs an agent to drive in a process of its own, per step, beside driving in the world's.

    python benchmarks/isolation.py

An agent of the prompt (`examples/your_own_agent.py`) and one that looks at four cameras of 256 x
144 and a LiDAR, both driven with and without, in turns, in one run. By the clock on the wall, which
others on the machine make longer, and by that of the CPU; prints and asserts nothing.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import di_envs
from agents import load_agent
from agents.base import Control, Observation, Requirements, make_control
from agents.isolated import AgentProcess, IsolatedAgent
from di_envs.town.plan import RoutePlan

TURNS, STEPS = 9, 60
TOP = Path(__file__).resolve().parent.parent
AGENTS = {
    "prompt": f"{TOP / 'examples' / 'your_own_agent.py'}:RouteFollower",
    "cameras and LiDAR": f"{Path(__file__).resolve()}:LooksAtAll",
}


class LooksAtAll:
    """Adds up all that it is shown, so that every byte has to be there."""

    requires = Requirements(observations=("camera", "lidar", "prompt"), control_dt_s=0.1)

    def start(self, plan: RoutePlan, seed: int) -> None:
        """There is nothing to remember."""

    def act(self, observation: Observation, memory: None) -> tuple[Control, None]:
        """Drives on, a little faster or slower by what it sees."""
        total = sum(int(np.asarray(value).astype(np.int64).sum()) for value in observation.values())
        return make_control(0.3 + (total % 7) / 100.0, 0.0, 0.0), memory

    def close(self) -> None:
        """There is nothing to free."""


def turn(env: Any, agent: Any, clock: Callable[[], float]) -> tuple[float, float, float]:
    """Milliseconds of a drive: of a decision and of a whole step by the clock on the wall, and of
    a step by the CPU clock of all who work."""
    observation, _ = env.reset(seed=0, options={"route": 0})
    memory, decisions, steps = agent.start(env.plan, 0), [], []
    began_s = clock()
    for _ in range(STEPS):
        start_s = time.perf_counter()
        control, memory = agent.act(observation, memory)
        decided_s = time.perf_counter()
        observation, *_ = env.step(control)
        decisions.append(1e3 * (decided_s - start_s))
        steps.append(1e3 * (time.perf_counter() - start_s))
    spent_ms = 1e3 * (clock() - began_s) / STEPS
    return statistics.median(decisions), statistics.median(steps), spent_ms


def measured(spec: str) -> tuple[int, dict[str, tuple[float, ...]]]:
    """Bytes of an observation; medians of `turn` without a process of its own and with one."""
    here, process = load_agent(spec), AgentProcess()
    apart = IsolatedAgent(process, spec)
    needs = apart.requires
    env = di_envs.RouteEnv(suite="town05_tiny", observations=needs.observations, **needs.options)
    others = (~process.id << 3) | 2  # Linux: the CPU clock of that process
    clocks: dict[str, tuple[Any, Callable[[], float]]] = {
        "without": (here, time.process_time),
        "with": (apart, lambda: time.process_time() + time.clock_gettime(others)),
    }
    taken: dict[str, list[tuple[float, ...]]] = {name: [] for name in clocks}
    for _ in range(TURNS + 1):  # the first is for warmth
        for name, (agent, clock) in clocks.items():
            taken[name].append(turn(env, agent, clock))
    shown = sum(np.asarray(value).nbytes for value in env.observe().values())
    process.stop()
    medians = {
        name: tuple(map(statistics.median, zip(*each[1:], strict=True)))
        for name, each in taken.items()
    }
    return shown, medians


def main() -> None:
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    table = Table(title="ms without -> with a process of its own")
    for column in ("agent", "bytes seen", "decision, wall", "step, wall", "step, CPU of all"):
        table.add_column(column, justify="left" if column == "agent" else "right")
    for name, spec in AGENTS.items():
        shown, found = measured(spec)
        pairs = zip(found["without"], found["with"], strict=True)
        table.add_row(name, str(shown), *(f"{one:.3f} -> {other:.3f}" for one, other in pairs))
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
