"""Whole steps of environments that see pictures: ours, highway-env's and Gymnasium's CarRacing.

Used by `sensors.py`. What is compared takes turns, round by round; times are of the processor.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from step_rate import record_drive

from di_envs.route_env import RouteEnv
from di_envs.sensors.camera.config import RIGS

VEHICLES, WALKERS = 120, 60
GROUPS = ("camera", "lidar", "prompt")
TICK_HZ, STEP_HZ = 20, 10
SEED = 0


@dataclass(frozen=True, kw_only=True)
class Contender:
    """An environment to be stepped along a list of actions, from a reset on."""

    name: str
    sees: str
    env: Any
    actions: list[Any]
    reset_options: dict[str, Any] | None = None

    def round_s(self) -> float:
        """Processor seconds a step, over all actions; a reset costs nothing here."""
        self.env.reset(seed=SEED, options=self.reset_options)
        begin = time.process_time()
        for action in self.actions:
            self.env.step(action)
        return (time.process_time() - begin) / len(self.actions)


def our_contenders(small_steps: int, paper_steps: int) -> list[Contender]:
    """Town05 Long with the small rig and with the paper's, along a drive of the expert."""
    options: dict[str, Any] = {"suite": "town05_long", "traffic": VEHICLES, "walkers": WALKERS}
    drive = record_drive(RouteEnv(observations=("prompt",), **options), small_steps / STEP_HZ)
    found = []
    for cameras, steps in (("small", small_steps), ("paper", paper_steps)):
        env = RouteEnv(observations=GROUPS, cameras=cameras, lidar="paper", **options)
        camera = RIGS[cameras].cameras[0]
        found.append(
            Contender(
                name=f"DriveInsight-Town05Long, rig {cameras}",
                sees=f"4 x {camera.width}x{camera.height} RGB, LiDAR, prompt",
                env=env,
                actions=drive[:steps],
                reset_options={"route": 0},
            )
        )
    return found


def highway_contender(steps: int) -> Contender:
    """highway-env's own motorway with its grayscale observation, as many cars, as many ticks."""
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # it draws with pygame, without a window here
    import highway_env  # noqa: F401 (registers the ids)

    config = {
        "observation": {
            "type": "GrayscaleObservation",
            "observation_shape": (128, 64),
            "stack_size": 4,
            "weights": [0.2989, 0.5870, 0.1140],
            "scaling": 1.75,
        },
        "vehicles_count": VEHICLES,
        "simulation_frequency": TICK_HZ,
        "policy_frequency": STEP_HZ,
        "duration": 3600,
    }
    env = gymnasium.make("highway-v0", config=config).unwrapped
    return Contender(
        name="highway-env highway-v0", sees="4 x 128x64 grey", env=env, actions=[1] * steps
    )


def racing_contender(steps: int) -> Contender | None:
    """Gymnasium's CarRacing: one car and no traffic; None where Box2D is not installed."""
    try:
        env = gymnasium.make("CarRacing-v3").unwrapped
    except gymnasium.error.DependencyNotInstalled:
        return None
    action = np.array([0.0, 0.1, 0.0])
    return Contender(
        name="Gymnasium CarRacing-v3", sees="96x96 RGB", env=env, actions=[action] * steps
    )


def step_rates(
    contenders: list[Contender], rounds: int, tell: Callable[[str], None]
) -> dict[str, tuple[float, float]]:
    """Median and best steps a second of each.

    Args:
        contenders: They take turns.
        rounds: Counted ones, after a first.
        tell: Is told what is being timed.
    """
    seconds: dict[str, list[float]] = {contender.name: [] for contender in contenders}
    for _ in range(rounds + 1):
        for contender in contenders:
            tell(contender.name)
            seconds[contender.name].append(contender.round_s())
    return {
        name: (1.0 / statistics.median(found[1:]), 1.0 / min(found[1:]))
        for name, found in seconds.items()
    }
