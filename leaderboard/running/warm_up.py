"""Compiles what a drive in this process needs before it begins, and tells when that takes time.

The first run of a version on a kind of CPU compiles for a minute; later ones load machine code from
the cache and show nothing. A few steps of the route that is to be driven touch every kernel.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from rich.console import Console

from agents import load_agent
from leaderboard.running.bound import light_limited_bound
from leaderboard.running.compiling import compile_progress
from leaderboard.running.driver import Driver
from leaderboard.running.episode import extra_keys, plan_shown
from leaderboard.running.jobs import RunSpec
from leaderboard.running.messages import Scene
from leaderboard.running.setting_up import scene_of, set_up
from leaderboard.running.wall_clock import Stopwatch

WARM_UP_STEPS = 3


def warm_up(spec: RunSpec, console: Console) -> Scene:
    """Drives the first steps of a route, so that every kernel is compiled and cached.

    What the agent does wrong while driving is not reported: it will do it where it counts.

    Raises:
        SetupError: If the agent cannot be made, or the environment refuses its options.
    """
    with compile_progress(console), set_up(spec, Stopwatch()) as driver:
        _drive_a_little(spec, driver)
        return scene_of(driver)


def _drive_a_little(spec: RunSpec, driver: Driver) -> None:
    """Lets the agent decide once, then holds the brake: these steps run every kernel."""
    view = driver.env.view
    observation = driver.env.observe()
    with suppress(Exception, SystemExit):
        agent = load_agent(spec.agent)
        memory = agent.start(plan_shown(driver.requires, view.plans[view.ego]), 0)
        agent.act({**observation, **extra_keys(agent.requires, view)}, memory)
        agent.close()
    for _ in range(WARM_UP_STEPS):
        driver.env.step(np.array([0.0, 0.0, 1.0], dtype=np.float32))
    light_limited_bound(view.town, view.plans[view.ego], 0)
