"""Compiles the kernels before the first test, so that no test's time holds somebody's compiling.

The first steps of a drive with every sensor touch the kernels that nearly all tests use; every
process that a test starts then loads what they made. Which sources were compiled last stands in
pytest's cache: unchanged ones are not driven again.
"""

from __future__ import annotations

import hashlib
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

SENSORS = ("prompt", "inertial", "odometry", "camera", "lidar")
TOP = Path(__file__).resolve().parent.parent
REMEMBERED = "driveinsight/kernels"  # a key of pytest's cache
STEPS = 3


def compile_kernels(config: pytest.Config) -> None:
    """Compiles what the sources as they are ask for, with a line and a bar if there is much."""
    from di_envs.numerics.kernels import kernel_cache
    from leaderboard.running.compiling import compile_progress

    digest, cache = sources(), getattr(config, "cache", None)  # none with -p no:cacheprovider
    if cache and kernel_cache().is_dir() and cache.get(REMEMBERED, "") == digest:
        return
    with shown(config), compile_progress(Console()):
        drive_a_little()
    if cache:
        cache.set(REMEMBERED, digest)


def sources() -> str:
    """Names all sources of kernels, the CPU and Numba."""
    from di_envs.numerics.kernels import kernel_sources, sources_digest

    modules = (path.relative_to(TOP).with_suffix("").parts for path in kernel_sources())
    return hashlib.sha256(
        "".join(sources_digest(".".join(m)) for m in modules).encode()
    ).hexdigest()


def shown(config: pytest.Config) -> AbstractContextManager[None]:
    """Lets through to the terminal what pytest keeps to itself."""
    capture = config.pluginmanager.getplugin("capturemanager")
    return capture.global_and_fixture_disabled() if capture else nullcontext()


def drive_a_little() -> None:
    """The expert decides once, then the brake is held: these steps run nearly every kernel."""
    from agents import load_agent
    from di_envs.route_env import RouteEnv
    from di_envs.vector_env import RouteVectorEnv
    from leaderboard.running.bound import light_limited_bound

    options = {"suite": "toy", "traffic": 4, "walkers": 4}
    env = RouteEnv(observations=SENSORS, **options)
    observation, _ = env.reset(seed=0)
    expert = load_agent("expert")
    expert.act({**observation, "world": env.view}, expert.start(env.plan, 0))
    for _ in range(STEPS):
        env.step(np.array([0.0, 0.0, 1.0], np.float32))
    worlds = RouteVectorEnv(1, observations=("prompt",), **options)
    worlds.reset(seed=0)
    worlds.step(np.array([[0.0, 0.0, 1.0]], np.float32))
    light_limited_bound(env.view.town, env.plan, 0)
