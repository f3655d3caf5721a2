"""Scenario 1, control loss: debris on the road, over which steering and throttle are disturbed.

Three patches lie 14, 48 and 74 m ahead, flat: one drives over them. While the ego is within 2 m of
one, noise is added to its controls each tick: throttle ±0.03 (standard deviation 0.01), steering
±0.055 (0.015), the signs drawn for each patch. They are gone 110 m behind the trigger.
Source: CARLA scenario_runner, branch `leaderboard-2.0`, `ControlLoss` and `AddNoiseToRouteEgo`. In
the branch `leaderboard-1.0` noise is set but never applied, so nothing would be lost.
"""

from __future__ import annotations

import math

from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, normal
from di_envs.town.lanes import Signals
from di_envs.world.bodies import SAME_LEVEL_M
from di_envs.world.scenarios.steps import ITEMS, draw_of, end_scenario, go_to, put_actor
from di_envs.world.scenarios.tables import ScenarioTables
from di_envs.world.state import ActorKind, State

RUNNING = 1
WITHIN_M = 2.0  # of a patch's middle, the ego's middle
THROTTLE_MEAN, THROTTLE_DEVIATION = 0.03, 0.01
STEER_MEAN, STEER_DEVIATION = 0.055, 0.015
HALF_LENGTH_M, HALF_WIDTH_M, HEIGHT_M = 1.0, 0.9, 0.08
STEER_ITEM, THROTTLE_ITEM = 1, 5  # and the patch's number: the draws of the signs

DEBRIS = int(ActorKind.DEBRIS)
STEER_STREAM, THROTTLE_STREAM = int(Stream.STEER_NOISE), int(Stream.THROTTLE_NOISE)


@kernel
def begin_debris(state: State, tables: ScenarioTables, trigger: int) -> None:
    """Lays the patches down."""
    first = tables.first_actor[0]
    for actor in range(tables.first_actor[trigger], tables.first_actor[trigger + 1]):
        pose = tables.pose[actor - first]
        if not math.isnan(pose[0]):
            put_actor(
                state,
                actor,
                DEBRIS,
                pose[0],
                pose[1],
                pose[2],
                pose[3],
                HALF_LENGTH_M,
                HALF_WIDTH_M,
                HEIGHT_M,
            )
    go_to(state, trigger, RUNNING)


@kernel
def disturb_ego(state: State, tables: ScenarioTables, trigger: int, ego: int) -> None:
    """Adds this tick's noise where the ego is over a patch."""
    first = tables.first_actor[trigger]
    for actor in range(first, tables.first_actor[trigger + 1]):
        dx, dy = state.x[actor] - state.x[ego], state.y[actor] - state.y[ego]
        if state.kind[actor] != DEBRIS or dx * dx + dy * dy > WITHIN_M * WITHIN_M:
            continue
        if abs(state.z[actor] - state.z[ego]) > SAME_LEVEL_M:
            continue
        patch = actor - first
        seed, tick = int(state.seed[()]), int(state.tick[()])
        key = ((trigger - tables.start[ego]) * ITEMS + patch) * 1024 + ego
        steer = STEER_DEVIATION * normal(seed, STEER_STREAM, tick, key)
        throttle = THROTTLE_DEVIATION * normal(seed, THROTTLE_STREAM, tick, key)
        left = draw_of(state, tables, ego, trigger, STEER_ITEM + patch) < 0.5
        less = draw_of(state, tables, ego, trigger, THROTTLE_ITEM + patch) < 0.5
        state.steer_noise[ego] += steer - STEER_MEAN if left else steer + STEER_MEAN
        state.throttle_noise[ego] += throttle - THROTTLE_MEAN if less else throttle + THROTTLE_MEAN


@kernel
def watch_debris(
    state: State, tables: ScenarioTables, signals: Signals, trigger: int, done_m: float
) -> None:
    """Clears the road once the ego has come far enough."""
    if done_m >= tables.end_m[trigger]:
        end_scenario(state, tables, signals, trigger)
