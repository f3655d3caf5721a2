"""A world with nobody in it but one ego on its route: its lights, and scenarios that change them.

It is what the light-limited bound is driven in. The lights are the world's own, tick for tick; so
is what scenarios 7 to 9 make of them, which depends on where the ego is.
"""

from __future__ import annotations

import bisect
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import LightState
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.building import route_arrays
from di_envs.world.events.rows import COLUMNS
from di_envs.world.lights import GREEN_TICKS, YELLOW_TICKS, advance_lights, start_lights
from di_envs.world.scenarios.staging import watch_scenarios
from di_envs.world.scenarios.tables import actors_needed, scenario_tables
from di_envs.world.state import (
    TICK_S,
    ActorKind,
    Capacity,
    State,
    state_dtype,
    views_of,
)


class QuietWorld:
    """The lights of a world, for an ego that is put along its route tick by tick.

    Attributes:
        light: (S,) what each signal head shows now: always the same array.
    """

    def __init__(self, town: Town, plan: RoutePlan, world_seed: int) -> None:
        self._town, self._plan = town, plan
        capacity = _capacity(town, plan)
        self._state = _empty_state(capacity, world_seed)
        self.light: NDArray[np.int8] = self._state.light
        start_lights(self._state, town.signals)
        self._route_m: list[Any] = plan.route_m.tolist()
        if plan.scenarios:
            self._routes = route_arrays((plan,))
            self._tables = scenario_tables(town, (plan,), capacity.first_scenario_actor)
            self._rows = np.zeros((1, COLUMNS))

    def advance(self, done_m: float) -> None:
        """One tick, at the end of which the ego has come so far along its route."""
        state, signals = self._state, self._town.signals
        state.tick[...] += 1
        advance_lights(state, signals)
        if not self._plan.scenarios:
            return
        state.x[0], state.y[0], state.z[0] = self._place(done_m)
        watch_scenarios(state, self._tables, signals, self._routes, 0, self._rows, 0)

    def yellow_left_s(self, signal: int) -> float:
        """How long a light stays yellow before it is red; 0 for one that is not yellow."""
        state = self._state
        if state.light[signal] != LightState.YELLOW:
            return 0.0
        junction = self._town.signals.junction[signal]
        if state.held_by[junction]:
            ticks = int(state.held_until[junction] - state.tick)
        else:
            ticks = GREEN_TICKS + YELLOW_TICKS - int(state.phase_ticks[junction])
        return ticks * TICK_S

    def _place(self, done_m: float) -> NDArray[np.float64]:
        """(3,) x, y, z of the route after so many metres."""
        points, route_m = self._plan.points, self._route_m
        after = min(max(bisect.bisect_right(route_m, done_m), 1), len(route_m) - 1)
        step_m = route_m[after] - route_m[after - 1]
        share = min((done_m - route_m[after - 1]) / step_m, 1.0) if step_m > 0.0 else 1.0
        place: NDArray[np.float64] = (1.0 - share) * points[after - 1] + share * points[after]
        return place[:3]


def _capacity(town: Town, plan: RoutePlan) -> Capacity:
    return Capacity(
        egos=1,
        vehicles=0,
        walkers=0,
        props=0,
        junctions=town.signals.groups.size,
        signals=town.signals.kind.size,
        triggers=len(plan.scenarios),
        scenario_actors=actors_needed((plan,)),
    )


def _empty_state(capacity: Capacity, world_seed: int) -> State:
    state = views_of(np.zeros(1, state_dtype(capacity)))
    state.seed[()] = world_seed
    state.kind[0] = ActorKind.CAR
    return state
