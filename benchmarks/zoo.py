"""What a decision of each system of the zoo costs on one core, and how large each is.

    python benchmarks/zoo.py

Prints the rows of the table in docs/zoo.md. Weights are fresh: a decision costs the same with any.
Time is the processor's, the median of `DECISIONS` after two that do not count, with sensors read.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from torch import nn

import di_envs
from agents import load_agent
from agents.base import Agent
from agents.zoo.registry import config_of, network_of, system_names
from agents.zoo.weights import save_system

DECISIONS = 15


def system_cost(name: str) -> tuple[int, float]:
    """Parameters of a system, and the milliseconds of a decision."""
    network = network_of(config_of(name))
    with tempfile.TemporaryDirectory() as folder:
        save_system(network, Path(folder), "fresh weights")
        agent = load_agent(f"zoo:{folder}")
    return parameters_of(network), decision_ms(agent)


def parameters_of(network: nn.Module) -> int:
    """How many numbers it has learnt."""
    return sum(parameter.numel() for parameter in network.parameters())


def decision_ms(agent: Agent[Any]) -> float:
    """Processor time of a whole decision on the toy suite."""
    needs = agent.requires
    env = di_envs.RouteEnv(suite="toy", observations=needs.observations, **needs.options)
    observation, _ = env.reset(seed=0)
    seen = {**observation, "world": env.view}
    memory, spent_ms = agent.start(env.plan, 0), []
    for _ in range(DECISIONS + 2):
        begun = time.process_time()
        _, memory = agent.act(seen, memory)
        spent_ms.append(1000.0 * (time.process_time() - begun))
    return float(np.median(spent_ms[2:]))


def main() -> None:
    """Prints a row for each system."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    print("| system | parameters | MB in float16 | ms a decision |\n|---|---:|---:|---:|")
    for name in system_names():
        size, milliseconds = system_cost(name)
        print(f"| `{name}` | {size:,} | {2e-6 * size:.2f} | {milliseconds:.0f} |", flush=True)


if __name__ == "__main__":
    main()
