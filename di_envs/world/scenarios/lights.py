"""Scenarios 7, 8 and 9 at junctions with lights: another arm gets green with the ego's.

The ego's arm is green and all others red until the ego is 10 m before the junction; then it is
yellow for 2 s, then red for 1.5 s and 0.04 s for each metre between the two lights, while the other
arm is green; then both are green until the ego has left. Then turns go on where they stood.
Source: CARLA scenario_runner, branch `leaderboard-1.0`, `TrafficLightManipulator`; the limit of
180 s is that of its `SignalJunctionCrossingRoute`.
"""

from __future__ import annotations

from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import LightState, Signals
from di_envs.world.lights import hold_lights
from di_envs.world.scenarios.steps import end_scenario, go_to
from di_envs.world.scenarios.tables import ScenarioTables
from di_envs.world.state import TICK_S, State

WAITS, GREEN, YELLOW, RED, BOTH = 1, 2, 3, 4, 5
NEAR_M = 10.0  # from the ego's middle to the junction
YELLOW_TICKS = round(2.0 / TICK_S)
LIMIT_TICKS = round(180.0 / TICK_S)

_GREEN, _YELLOW, _RED = int(LightState.GREEN), int(LightState.YELLOW), int(LightState.RED)


@kernel
def begin_lights(state: State, tables: ScenarioTables, signals: Signals, trigger: int) -> None:
    """Takes the lights, unless another scenario has them; without two lights nothing happens."""
    if tables.signal[trigger] < 0:
        end_scenario(state, tables, signals, trigger)
        return
    go_to(state, trigger, WAITS)
    _take_lights(state, tables, signals, trigger)


@kernel
def _take_lights(state: State, tables: ScenarioTables, signals: Signals, trigger: int) -> None:
    """Takes the junction's lights, if no other scenario has them, and gives the ego's arm green."""
    junction = tables.junction[trigger]
    if state.held_by[junction] == 0:
        hold_lights(state, signals, junction, trigger + 1)
        state.forced_light[tables.signal[trigger]] = _GREEN
        go_to(state, trigger, GREEN)


@kernel
def _square_to_stop(state: State, tables: ScenarioTables, trigger: int, ego: int) -> float:
    """Squared distance of an ego from its stop line [m2]."""
    dx = state.x[ego] - tables.stop[trigger, 0]
    dy = state.y[ego] - tables.stop[trigger, 1]
    dz = state.z[ego] - tables.stop[trigger, 2]
    return dx * dx + dy * dy + dz * dz


@kernel
def watch_lights(
    state: State, tables: ScenarioTables, signals: Signals, trigger: int, ego: int, done_m: float
) -> None:
    """One tick: who comes near sees yellow, then the other arm goes, then both may."""
    step, tick = state.scenario_step[trigger], state.tick[()]
    since = tick - state.scenario_tick[trigger]
    if done_m >= tables.end_m[trigger] or since > LIMIT_TICKS:
        end_scenario(state, tables, signals, trigger)
    elif step == WAITS:
        _take_lights(state, tables, signals, trigger)
    elif step == GREEN:
        if _square_to_stop(state, tables, trigger, ego) < NEAR_M * NEAR_M:
            state.forced_light[tables.signal[trigger]] = _YELLOW
            state.held_until[tables.junction[trigger]] = tick + YELLOW_TICKS
            go_to(state, trigger, YELLOW)
    elif step == YELLOW:
        if since >= YELLOW_TICKS:
            state.forced_light[tables.signal[trigger]] = _RED
            state.forced_light[tables.other_signal[trigger]] = _GREEN
            go_to(state, trigger, RED)
    elif step == RED:
        if since >= tables.red_ticks[trigger]:
            state.forced_light[tables.signal[trigger]] = _GREEN
            go_to(state, trigger, BOTH)
