"""Compiles what a drive needs before it begins: a few steps of its route touch every kernel.

The first run of a version on a kind of CPU compiles for half a minute; later ones load machine code
from the cache.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

from agents.base import Agent
from leaderboard.running.bound import light_limited_bound
from leaderboard.running.episode import extra_keys, plan_shown
from leaderboard.running.jobs import Job

WARM_UP_STEPS = 3


def warm_up(env: Any, agent: Agent[Any], job: Job) -> None:
    """Drives the first steps of a route; whoever drives it then begins it anew.

    The agent decides once, unless it hides its memory and so could not begin anew. What it does
    wrong is not reported: it will do it where it counts.

    Args:
        env: A `RouteEnv`, wrapped or not.
        agent: That will drive.
        job: The route and the seed.
    """
    observation, _ = env.reset(seed=job.world_seed, options={"route": job.route_id})
    view = env.unwrapped.view
    plan = view.plans[view.ego]
    with suppress(Exception, SystemExit):
        if agent.requires.branchable:
            memory = agent.start(plan_shown(agent.requires, plan), job.world_seed)
            agent.act({**observation, **extra_keys(agent.requires, view)}, memory)
    for _ in range(WARM_UP_STEPS):
        env.step(np.array([0.0, 0.0, 1.0], dtype=np.float32))
    light_limited_bound(view.town, plan, job.world_seed)
