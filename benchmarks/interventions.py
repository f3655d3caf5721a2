"""What an edit of the observation costs, beside the step that makes the observation.

    python benchmarks/interventions.py

CPU time of one core, with 120 vehicles in Town05. The share is that of a step of the environment
alone, and of one with a policy's decision in it, as in an evaluation: `driveinsight` where there
are cameras, `driveinsight-told` otherwise; untrained, which takes as long. With cameras it takes
half a minute.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from agents.base import Observation
from agents.driveinsight.agent import DriveInsightAgent
from agents.driveinsight.config import config_named
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import save_pretrained
from di_envs.route_env import RouteEnv
from di_envs.town.plan import RoutePlan
from wrappers.interventions import ObservationEditing
from wrappers.interventions.context import context_of

EDITS = (
    "identity:speed", "drop:routing", "zero:routing", "clear:obstacles", "set:speed=10",
    "noise:map,sigma=0.5", "mask:map,p=0.3", "recolour:lights=red@t>5",
    "shift:routing+target_point,lateral=3.5", "replace:command=LEFT", "delay:speed,steps=5",
    "blackout:camera_left", "noise:camera_front,sigma=8", "thin:lidar,keep=0.25",
)  # fmt: skip
POLICIES = ("driveinsight-told", "driveinsight")
STAND = np.array([0.0, 0.0, 1.0], np.float32)


def cpu_us(work: Callable[[], object], repeats: int, rounds: int = 5) -> float:
    """Microseconds of CPU that it takes, the best of some rounds."""
    best = float("inf")
    for _ in range(rounds):
        start_s = time.process_time()
        for _ in range(repeats):
            work()
        best = min(best, (time.process_time() - start_s) / repeats)
    return best * 1e6


def measured(policy: str) -> Table:
    """What each edit costs where what that policy reads is observed."""
    agent = untrained(policy)
    groups, options = agent.requires.observations, agent.requires.options
    env = RouteEnv(suite="town05_tiny", traffic=120, walkers=60, observations=groups, **options)
    env.reset(seed=0, options={"route": 0})
    step_us = cpu_us(lambda: env.step(STAND), 40)
    observation, *_, info = env.step(STAND)
    decision_us = cpu_us(decision(agent, observation, env.plan), 20)
    table = Table(
        title=f"{' '.join(groups)}: a step takes {step_us:.0f} us, a decision of `{policy}` "
        f"{decision_us:.0f} us"
    )
    for name in ("edit", "us", "% of a step", "% with a decision"):
        table.add_column(name, justify="left" if name == "edit" else "right")
    for text in EDITS:
        target = text.partition(":")[2].partition(",")[0]
        if "camera" not in groups and target.startswith(("camera", "lidar")):
            continue
        editing = ObservationEditing(text, env.observation_space)

        def edit(editing: ObservationEditing = editing) -> None:
            context = context_of(info, env.config.control_dt_s)
            editing.apply(observation, context, editing.start())

        edit_us = cpu_us(edit, 200 if target != "camera_front" else 10)
        shares = (100.0 * edit_us / whole for whole in (step_us, step_us + decision_us))
        table.add_row(text, f"{edit_us:.1f}", *(f"{share:.2f}" for share in shares))
    return table


def untrained(policy: str) -> DriveInsightAgent:
    """A driver of that configuration."""
    with tempfile.TemporaryDirectory() as folder:
        save_pretrained(Policy(config_named(policy)), Path(folder), "Untrained.")
        return DriveInsightAgent(weights=folder)


def decision(
    agent: DriveInsightAgent, observation: Observation, plan: RoutePlan
) -> Callable[[], object]:
    """A policy's decision, late enough in a drive that its memory is full."""
    memory = agent.start(plan, 0)
    for _ in range(20):
        _, memory = agent.act(observation, memory)
    return lambda: agent.act(observation, memory)


def main() -> None:
    """Prints a table for each policy."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    console = Console()
    for policy in POLICIES:
        console.print(measured(policy))


if __name__ == "__main__":
    main()
