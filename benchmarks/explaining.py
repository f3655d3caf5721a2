"""What a look into a policy costs, beside the decision that it looks at.

    python benchmarks/explaining.py

Untrained weights: they cost the same. CPU time of one core; prints and asserts nothing.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import torch
from rich.console import Console
from rich.table import Table

import di_envs
from agents import load_agent
from agents.driveinsight.config import config_named
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import save_pretrained
from agents.explain.activation import activation_maps
from agents.explain.look import look_at
from agents.explain.responses import responses_at

CONFIGS = ("driveinsight", "driveinsight-told", "tiny")
DECISIONS = 12  # driven first, so that there is something to remember


def cpu_ms(work: Callable[[], object], repeats: int = 10) -> float:
    """Milliseconds of CPU that it takes: the median of some repeats, after one for warmth."""
    work()
    taken = []
    for _ in range(repeats):
        start_s = time.process_time()
        work()
        taken.append(time.process_time() - start_s)
    return sorted(taken)[repeats // 2] * 1e3


def measured(name: str, folder: Path) -> tuple[float, ...]:
    """A step, a decision, its responses, its maps, and both, of a policy of that configuration."""
    save_pretrained(Policy(config_named(name)), folder, "untrained")
    agent = load_agent(f"driveinsight:{folder}")
    needs = agent.requires
    env = di_envs.RouteEnv(suite="town05_tiny", observations=needs.observations, **needs.options)
    observation, _ = env.reset(seed=0, options={"route": 0})
    memory = agent.start(env.plan, 0)
    for _ in range(DECISIONS):
        control, memory = agent.act(observation, memory)
        observation, *_ = env.step(control)
    return (
        cpu_ms(lambda: env.step(control)),
        cpu_ms(lambda: agent.act(observation, memory)),
        cpu_ms(lambda: responses_at(agent, observation, memory)),
        cpu_ms(lambda: activation_maps(agent, observation, memory)),
        cpu_ms(lambda: look_at(agent, observation, memory)),
    )


def main() -> None:
    """Prints a row for each configuration."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(0)
    table = Table(title="ms of one core; 60 s: 600 decisions, one in five looked at [s]")
    for column in ("policy", "step", "act", "responses", "maps", "both", "60 s"):
        table.add_column(column, justify="left" if column == "policy" else "right")
    with tempfile.TemporaryDirectory() as folder:
        for name in CONFIGS:
            step, act, responses, maps, both = measured(name, Path(folder) / name)
            whole_s = (600 * (step + act) + 120 * both) / 1e3
            cells = (step, act, responses, maps, both, whole_s)
            table.add_row(name, *(f"{cell:.1f}" for cell in cells))
    Console().print(table)


if __name__ == "__main__":
    main()
