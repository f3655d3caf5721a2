"""What the state machines of all scenarios share: their first and last step, and their actors."""

from __future__ import annotations

from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.world.lights import release_lights
from di_envs.world.scenarios.tables import DONE
from di_envs.world.state import ActorKind

ITEMS = 16  # draws that a trigger may make

ABSENT = int(ActorKind.ABSENT)
STREAM = int(Stream.SCENARIO)


@kernel
def go_to(state, trigger, step):
    """Begins a step of a trigger's scenario."""
    state.scenario_step[trigger] = step
    state.scenario_tick[trigger] = state.tick[()]


@kernel
def draw_of(state, tables, ego, trigger, item):
    """A number in [0, 1): a function of the seed, the trigger's number in its ego's plan, the ego
    and the item (below ITEMS) that it is drawn for."""
    number = trigger - tables.start[ego]
    return uniform(state.seed[()], STREAM, number * ITEMS + item, ego)


@kernel
def put_actor(state, actor, kind, x, y, z, yaw, half_length, half_width, height):
    """Puts a scenario's actor into its slot, at rest."""
    state.kind[actor] = kind
    state.x[actor], state.y[actor], state.z[actor], state.yaw[actor] = x, y, z, yaw
    state.half_length[actor], state.half_width[actor] = half_length, half_width
    state.height[actor] = height
    state.speed[actor] = state.acceleration[actor] = state.yaw_rate[actor] = 0.0


@kernel
def end_scenario(state, tables, signals, trigger):
    """Takes a scenario's actors away, gives its lights back and lets it be done."""
    for actor in range(tables.first_actor[trigger], tables.first_actor[trigger + 1]):
        state.kind[actor] = ABSENT
        state.speed[actor] = state.acceleration[actor] = 0.0
    junction = tables.junction[trigger]
    if junction >= 0 and state.held_by[junction] == trigger + 1:
        release_lights(state, signals, junction)
    go_to(state, trigger, DONE)
