"""Compiles kernels and reads shipped maps before anybody waits for them.

What a first step of each kind needs is done once: a drive with every sensor, an expert's decision,
many worlds at once. Whoever comes later finds it all in the caches.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from agents import load_agent
from di_envs.config import OBSERVATION_GROUPS
from di_envs.route_env import RouteEnv
from di_envs.sensors.camera.config import rig_of
from di_envs.sensors.lidar.config import lidar_of
from di_envs.suites import suite_names
from di_envs.vector_env import RouteVectorEnv
from leaderboard.running.bound import light_limited_bound

STEPS = 3
STAND = np.array([0.0, 0.0, 1.0], np.float32)
FEW: Mapping[str, Any] = MappingProxyType({"suite": "toy", "traffic": 4, "walkers": 4})


def read_maps() -> None:
    """Reads the map of every shipped suite, and works out what follows from it: routes, tables."""
    for suite in suite_names():
        RouteEnv(suite=suite, observations=("prompt",)).close()


def drive_a_little() -> None:
    """The expert decides once, then the brake is held, with every sensor on."""
    env = RouteEnv(
        observations=OBSERVATION_GROUPS,
        cameras=dataclasses.replace(rig_of("small"), depth=True, semantic=True, instance=True),
        lidar=dataclasses.replace(lidar_of("paper"), semantic=True, instance=True),
        **FEW,
    )
    observation, _ = env.reset(seed=0)
    expert = load_agent("expert")
    expert.act({**observation, "world": env.view}, expert.start(env.plan, 0))
    for _ in range(STEPS):
        env.step(STAND)
    light_limited_bound(env.view.town, env.plan, 0)


def step_many() -> None:
    """Worlds of a vector environment are stepped once."""
    envs = RouteVectorEnv(1, observations=("prompt",), **FEW)
    envs.reset(seed=0)
    envs.step(STAND[None])
    envs.close()


# What there is to do, by what it is for
WORKS: Mapping[str, Callable[[], None]] = MappingProxyType(
    {
        "the shipped maps and routes": read_maps,
        "a drive with every sensor": drive_a_little,
        "many worlds at once": step_many,
    }
)
