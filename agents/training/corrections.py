"""Drives of a learner, with what the expert would have done from each of its moments on.

A policy that has only seen the expert's own drives has never seen what comes of its own mistakes.
As a world can be saved and restored to the bit, the expert takes over at every moment, is watched
for as long as waypoints reach, and the learner then drives on as if nothing had been.
Source: Ross, Gordon and Bagnell, A Reduction of Imitation Learning and Structured Prediction to
No-Regret Online Learning (DAgger), AISTATS 2011.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import load_agent
from agents.base import Agent, Control
from agents.training.frames import FRAME_S, DriveLog
from di_envs.route_env import RouteEnv
from di_envs.world.kinds import TICK_S, EventKind
from di_envs.world.world import Event, World

SHOWN = 8  # positions of the expert that are kept, as many as there are waypoints
STANDING_S = 40.0  # after which a learner is not waited for any longer; reds last less
# After these a learner's drive is over: what comes next has nothing to do with driving.
CRASHES = (
    *(EventKind.COLLISION_WALKER, EventKind.COLLISION_VEHICLE, EventKind.COLLISION_STATIC),
    *(EventKind.ROUTE_DEVIATION, EventKind.BLOCKED),
)
# What the expert is not to be followed into, when the learner left it no way out
_SPOILT = (*CRASHES, EventKind.RED_LIGHT, EventKind.STOP_SIGN, EventKind.OUTSIDE_LANES)


def corrected_drive(
    env: RouteEnv, learner: Agent[Any], observation: dict[str, Any], seed: int
) -> tuple[DriveLog, NDArray[np.float64], list[Event], str]:
    """Lets the learner drive a route that was just begun, and the expert correct it.

    Args:
        env: Just reset.
        learner: Whose requirements the environment was made with.
        observation: Of the reset.
        seed: Of the episode.

    Returns:
        The log, with the expert's controls; (F, `SHOWN`, 2) where the expert would have been each
        `FRAME_S` afterwards, not a number from where it would have broken a rule; the events; and
        how the drive ended.
    """
    expert, branch = load_agent("expert"), env.world.twin()
    expert_memory, memory = expert.start(env.plan, seed), learner.start(env.plan, seed)
    every = round(FRAME_S / env.config.control_dt_s)
    log, shown, events = DriveLog(view=env.view), [], list[Event]()
    step, stood, ended = 0, 0, ""
    while not ended:
        seen = {**observation, "world": env.view}
        control, expert_memory = expert.act(seen, expert_memory)
        if step % every == 0:
            log.add(control)
            branch.restore(env.world.save())
            shown.append(_shown(branch, expert, expert_memory, control, env.config.control_ticks))
        control, memory = learner.act(seen if learner.requires.privileged else observation, memory)
        observation, _, terminated, truncated, info = env.step(control)
        events += info["events"]
        stood = stood + 1 if env.view.state.speed[0] < 0.1 else 0
        if terminated or truncated:
            ended = str(info["finished"])
        elif any(event.kind in CRASHES for event in info["events"]):
            ended = "crash"
        elif stood * env.config.control_dt_s > STANDING_S:
            ended = "standing"
        step += 1
    return log, np.stack(shown), events, ended


def _shown(
    world: World, expert: Agent[Any], memory: Any, control: Control, ticks: int
) -> NDArray[np.float64]:
    """(`SHOWN`, 2) where the expert would be, until it breaks a rule or the route is over.

    Args:
        world: Which it may drive on in.
        expert: It.
        memory: After its decision at the present moment.
        control: That decision.
        ticks: How long each one is held.
    """
    places = np.full((SHOWN, 2), np.nan)
    every, state = round(FRAME_S / (ticks * TICK_S)), world.view.state
    for step in range(1, SHOWN * every + 1):
        events = world.advance(control[None].astype(np.float64), ticks)
        if any(event.kind in _SPOILT for event in events):
            break
        if step % every == 0:
            places[step // every - 1] = state.x[0], state.y[0]
        if state.finished[0]:
            break
        control, memory = expert.act({"world": world.view}, memory)
    return places
