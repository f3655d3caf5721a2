"""The Leaderboard's scenarios 1, 3, 4, 7, 8, 9 and 10: what triggers them, and who acts each tick.

Each trigger of an ego's plan has a small state machine (`State.scenario_step`), run once; those of
several triggers, and of several egos, run beside each other. What each does is in the module of its
family. All draws are keyed by the trigger's number in its ego's plan. Type 10 brings nothing: there
is traffic at a junction without signals, as in CARLA.
Source: CARLA scenario_runner, branch `leaderboard-1.0`; docs/scenarios.md compares the two.
"""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Float64, Int32
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, Signals
from di_envs.world.events.rows import record
from di_envs.world.scenarios.crossers import (
    begin_crossing,
    move_crosser,
    occupy_lanes,
    watch_crossing,
)
from di_envs.world.scenarios.debris import begin_debris, disturb_ego, watch_debris
from di_envs.world.scenarios.lights import begin_lights, watch_lights
from di_envs.world.scenarios.steps import end_scenario
from di_envs.world.scenarios.tables import AHEAD, DONE, ScenarioTables
from di_envs.world.state import ActorKind, EventKind, Routes, State
from di_envs.world.traffic.occupancy import Occupancy

TRIGGER_M = 1.5  # from the trigger, within which the route point nearest the ego must lie
WINDOW = 5  # route points looked at beyond the nearest one so far

ABSENT = int(ActorKind.ABSENT)
SCENARIO = int(EventKind.SCENARIO)
DEBRIS, HIDDEN, CYCLIST = 1, 3, 4  # types
FIRST_LIGHTS, LAST_LIGHTS = 7, 9


@kernel
def occupy_crossings(
    occupancy: Occupancy, state: State, tables: ScenarioTables, lanes: Lanes, below: Int32
) -> None:
    """Enters who crosses a road into the lists that traffic reads; after `fill_occupancy`.

    `below` is scratch, (OCCUPIED_LANES,).
    """
    for trigger in range(tables.type.size):
        if _is_under_way(state, trigger) and _crosses(tables, trigger):
            occupy_lanes(occupancy, state, tables, lanes, trigger, below)


@kernel
def _is_under_way(state: State, trigger: int) -> bool:
    """Whether a trigger's scenario has begun and is not over."""
    return AHEAD < state.scenario_step[trigger] < DONE


@kernel
def _crosses(tables: ScenarioTables, trigger: int) -> bool:
    """Whether somebody crosses the road in a trigger's scenario."""
    return tables.type[trigger] == HIDDEN or tables.type[trigger] == CYCLIST


@kernel
def move_scenarios(
    state: State, tables: ScenarioTables, signals: Signals, vehicle_end: int, walker_end: int
) -> None:
    """Moves the actors of scenarios and sets the noise of controls; before egos move."""
    for ego in range(state.throttle.size):
        begin, end = tables.start[ego], tables.start[ego + 1]
        if begin < end:
            state.steer_noise[ego] = state.throttle_noise[ego] = 0.0
        for trigger in range(begin, end):
            if not _is_under_way(state, trigger):
                continue
            if tables.type[trigger] == DEBRIS:
                disturb_ego(state, tables, trigger, ego)
            elif _crosses(tables, trigger):
                move_crosser(state, tables, signals, trigger, ego, vehicle_end, walker_end)


@kernel
def watch_scenarios(
    state: State,
    tables: ScenarioTables,
    signals: Signals,
    routes: Routes,
    ego: int,
    out: Float64,
    n: int,
) -> int:
    """Triggers scenarios and lets those under way see where the ego is; after it is located.

    At most one is triggered in a tick.

    Args:
        state: The world.
        tables: `ScenarioTables`.
        signals: The town's signals.
        routes: The egos' routes.
        ego: The ego.
        out: (N, 8) event rows.
        n: Rows in use.

    Returns:
        The number of rows in use.
    """
    begin, end = tables.start[ego], tables.start[ego + 1]
    if begin == end:
        return n
    if state.finished[ego] != 0 or state.kind[ego] == ABSENT:
        _end_all(state, tables, signals, begin, end)
        return n
    _follow_route(state, routes, ego)
    done_m = routes.route_m[routes.start[ego] + state.nearest_index[ego]]
    for trigger in range(begin, end):
        if _is_under_way(state, trigger):
            _watch(state, tables, signals, trigger, ego, done_m)
    for trigger in range(begin, end):
        if state.scenario_step[trigger] == AHEAD and _is_reached(
            state, tables, routes, trigger, ego
        ):
            _begin(state, tables, signals, trigger, ego)
            state.counts[ego, SCENARIO] += 1
            at = routes.points[routes.start[ego] + tables.point[trigger]]
            return record(
                out,
                n,
                SCENARIO,
                ego,
                int(state.tick[()]),
                at[0],
                at[1],
                at[2],
                trigger - begin,
                tables.type[trigger],
            )
    return n


@kernel
def _follow_route(state: State, routes: Routes, ego: int) -> None:
    """Moves the nearest route point on, looking at the present one and the next few."""
    first, end = routes.start[ego], routes.start[ego + 1]
    here = first + state.nearest_index[ego]
    nearest, least = here, math.inf
    for point in range(here, min(here + WINDOW + 1, end)):
        dx = routes.points[point, 0] - state.x[ego]
        dy = routes.points[point, 1] - state.y[ego]
        dz = routes.points[point, 2] - state.z[ego]
        square = dx * dx + dy * dy + dz * dz
        if square <= least:
            nearest, least = point, square
    state.nearest_index[ego] = nearest - first


@kernel
def _is_reached(
    state: State, tables: ScenarioTables, routes: Routes, trigger: int, ego: int
) -> bool:
    """Whether the route point nearest the ego is close to a trigger's."""
    here = routes.points[routes.start[ego] + state.nearest_index[ego]]
    there = routes.points[routes.start[ego] + tables.point[trigger]]
    dx, dy, dz = here[0] - there[0], here[1] - there[1], here[2] - there[2]
    return dx * dx + dy * dy + dz * dz < TRIGGER_M * TRIGGER_M


@kernel
def _begin(state: State, tables: ScenarioTables, signals: Signals, trigger: int, ego: int) -> None:
    """Begins a trigger's scenario, by its family."""
    kind = tables.type[trigger]
    if kind == DEBRIS:
        begin_debris(state, tables, trigger)
    elif _crosses(tables, trigger):
        begin_crossing(state, tables, signals, trigger, ego)
    elif FIRST_LIGHTS <= kind <= LAST_LIGHTS:
        begin_lights(state, tables, signals, trigger)
    else:
        end_scenario(state, tables, signals, trigger)


@kernel
def _watch(
    state: State, tables: ScenarioTables, signals: Signals, trigger: int, ego: int, done_m: float
) -> None:
    """Lets a scenario under way see where the ego is: `done_m` metres along its route."""
    kind = tables.type[trigger]
    if kind == DEBRIS:
        watch_debris(state, tables, signals, trigger, done_m)
    elif _crosses(tables, trigger):
        watch_crossing(state, tables, trigger, done_m)
    else:
        watch_lights(state, tables, signals, trigger, ego, done_m)


@kernel
def _end_all(state: State, tables: ScenarioTables, signals: Signals, begin: int, end: int) -> None:
    """An ego whose route has ended leaves nothing behind."""
    for trigger in range(begin, end):
        if _is_under_way(state, trigger):
            end_scenario(state, tables, signals, trigger)
