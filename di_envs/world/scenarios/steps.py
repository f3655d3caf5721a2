"""What the state machines of all scenarios share: their first and last step, and their actors."""

from __future__ import annotations

from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.town.lanes import Signals
from di_envs.world.lights import release_lights
from di_envs.world.scenarios.tables import DONE, ScenarioTables
from di_envs.world.state import ActorKind, State

ITEMS = 16  # draws that a trigger may make

ABSENT = int(ActorKind.ABSENT)
STREAM = int(Stream.SCENARIO)


@kernel
def go_to(state: State, trigger: int, step: int) -> None:
    """Begins a step of a trigger's scenario."""
    state.scenario_step[trigger] = step
    state.scenario_tick[trigger] = state.tick[()]


@kernel
def draw_of(state: State, tables: ScenarioTables, ego: int, trigger: int, item: int) -> float:
    """A number in [0, 1): a function of the seed, the trigger's number in its ego's plan, the ego
    and the item (below ITEMS) that it is drawn for."""
    number = trigger - tables.start[ego]
    return uniform(int(state.seed[()]), STREAM, number * ITEMS + item, ego)


@kernel
def put_actor(
    state: State,
    actor: int,
    kind: int,
    x: float,
    y: float,
    z: float,
    yaw: float,
    half_length: float,
    half_width: float,
    height: float,
) -> None:
    """Puts a scenario's actor into its slot, at rest."""
    state.kind[actor] = kind
    state.x[actor], state.y[actor], state.z[actor], state.yaw[actor] = x, y, z, yaw
    state.half_length[actor], state.half_width[actor] = half_length, half_width
    state.height[actor] = height
    state.speed[actor] = state.acceleration[actor] = state.yaw_rate[actor] = 0.0


@kernel
def end_scenario(state: State, tables: ScenarioTables, signals: Signals, trigger: int) -> None:
    """Takes a scenario's actors away, gives its lights back and lets it be done."""
    for actor in range(tables.first_actor[trigger], tables.first_actor[trigger + 1]):
        state.kind[actor] = ABSENT
        state.speed[actor] = state.acceleration[actor] = 0.0
    junction = tables.junction[trigger]
    if junction >= 0 and state.held_by[junction] == trigger + 1:
        release_lights(state, signals, junction)
    go_to(state, trigger, DONE)
