"""A world: a town, a state, and `advance`, the only place where time moves."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.kernels import bind, prepare
from di_envs.town.lanes import LightState
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.building import (
    begin_episode,
    build_scenery,
    capacity_for,
    make_scratch,
    town_tables,
)
from di_envs.world.changes import (
    ChangeError,
    check_actor,
    force_light,
    move_vehicle_to,
    move_walker_to,
    remove_actor,
)
from di_envs.world.events.rows import COLUMNS, ROWS_PER_EGO
from di_envs.world.scenarios.tables import call_off, scenario_tables
from di_envs.world.state import Capacity, EventKind, State, state_dtype, views_of
from di_envs.world.step import Scenery, advance

BATCH_TICKS = 100  # at most, in one call of the kernel: so its event rows suffice
STATE_VERSION = "3"  # of the record's layout and meaning; a snapshot of another is refused


@dataclass(frozen=True, kw_only=True)
class WorldConfig:
    """How many others there are. Egos are given by the plans at reset."""

    vehicles: int = 120
    walkers: int = 60

    def __post_init__(self) -> None:
        for name in ("vehicles", "walkers"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must not be negative, got {getattr(self, name)}")


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that the rules count, or that ends a route."""

    kind: EventKind
    ego: int
    tick: int
    x: float
    y: float
    z: float
    other: int = -1  # the other actor, the signal, or -1
    value: float = 0.0  # metres for OUTSIDE_LANES


@dataclass(frozen=True, kw_only=True)
class WorldView:
    """A read-only look at a world, for privileged agents, renderers and tests."""

    town: Town
    state: State  # read-only arrays
    plans: tuple[RoutePlan, ...]
    capacity: Capacity
    ego: int = 0


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """A saved state: refuses to be restored into another town or layout."""

    town_hash: str
    version: str
    capacity: Capacity
    record: NDArray[np.void]
    plans: tuple[RoutePlan, ...]


class World:
    """One world. `view` always shows the present state; `reset` and `restore` make a new one."""

    def __init__(self, town: Town, config: WorldConfig | None = None) -> None:
        self.town = town
        self.config = config or WorldConfig()
        self._tables = town_tables(town)
        self._view: WorldView | None = None
        self._scenery: Scenery

    def twin(self) -> World:
        """Another world in the same town, without an episode; it shares the town's tables."""
        twin = copy.copy(self)
        twin._view = None
        return twin

    @property
    def view(self) -> WorldView:
        """The present state, read-only.

        Raises:
            RuntimeError: Before the first reset.
        """
        if self._view is None:
            raise RuntimeError("the world holds no episode yet; call reset(seed, plans) first")
        return self._view

    @property
    def moving_parts(self) -> tuple[State, Scenery]:
        """The state, to be changed by kernels, and what it stands on. Others after a reset.

        Raises:
            RuntimeError: Before the first reset.
        """
        self.view  # noqa: B018 (raises before the first reset)
        return self._state, self._scenery

    def reset(self, seed: int, plans: Sequence[RoutePlan]) -> None:
        """Starts an episode: egos at their routes' starts, traffic and walkers drawn from `seed`.

        Args:
            seed: 0 to 2**64 - 1; equal seeds give equal episodes, bit for bit.
            plans: One route an ego; none for a world of traffic alone.
        """
        self._allocate(tuple(plans))
        prepare(advance, self._arguments)
        view, spots = self.view, self._tables.spots
        begin_episode(self._state, seed, self._scenery, spots, view.capacity, view.plans)

    def advance(self, controls: NDArray[np.float64], ticks: int = 1) -> list[Event]:
        """Holds the egos' controls for some ticks and returns what happened.

        Args:
            controls: (E, 3) throttle 0..1, steer -1..1 (positive right), brake 0..1.
            ticks: How many ticks of TICK_S.
        """
        self.hold(controls)
        return self.run(ticks)

    def hold(self, controls: NDArray[np.float64]) -> None:
        """Sets the egos' controls, (E, 3) as for `advance`; they hold until others are set."""
        state = self._state
        state.throttle[:] = controls[:, 0]
        state.steer[:] = controls[:, 1]
        state.brake[:] = controls[:, 2]

    def run(self, ticks: int) -> list[Event]:
        """Lets time pass and returns what happened. Nearly all of it without Python's lock."""
        events: list[Event] = []
        if self._advance is None:
            self._bind()
        while ticks > 0:
            batch = min(ticks, BATCH_TICKS)
            rows = self._advance(
                self._state, self._scenery, self._scratch, self._vehicle_end, self._walker_end,
                batch, self._event_rows,
            )  # fmt: skip
            if rows:
                events += [event_of_row(row) for row in self._event_rows[:rows]]
            ticks -= batch
        return events

    def remove_actor(self, actor: int) -> None:
        """Takes an actor off the road for the rest of the episode; what it has done still counts.

        One whose scenario has not begun is not there yet: then that scenario never begins.

        Raises:
            ChangeError: If it is not there.
        """
        if not call_off(self._state, self._scenery.scenarios, actor):
            remove_actor(self._state, actor)

    def move_actor(self, actor: int, ahead_m: float, right_m: float) -> None:
        """Sets a vehicle or a walker of the traffic down elsewhere, on a lane or way nearby.

        Args:
            actor: Its id.
            ahead_m: How far along its own heading.
            right_m: How far to its right.

        Raises:
            ChangeError: If it is not there, or cannot be there.
        """
        state, capacity = self._state, self.view.capacity
        check_actor(state, actor)
        cos, sin = math.cos(state.yaw[actor]), math.sin(state.yaw[actor])
        x = float(state.x[actor]) + ahead_m * cos - right_m * sin
        y = float(state.y[actor]) + ahead_m * sin + right_m * cos
        if capacity.egos <= actor < self._vehicle_end:
            move_vehicle_to(state, self.town.lanes, self._tables.traffic, actor, x, y)
        elif self._vehicle_end <= actor < self._vehicle_end + capacity.walkers:
            move_walker_to(state, self._tables.walk, actor, x, y)
        else:
            raise ChangeError(
                f"actor {actor} cannot be moved: vehicles ({capacity.egos} to "
                f"{self._vehicle_end - 1}) and walkers (to "
                f"{self._vehicle_end + capacity.walkers - 1}) of the traffic can"
            )

    def force_light(self, light: int, shows: LightState) -> None:
        """Makes a light show one state from now on; NONE gives it back to its turn.

        Raises:
            ChangeError: If there is no such light.
        """
        force_light(self._state, self.town.signals, light, shows)

    def save(self) -> Snapshot:
        """Copies the state whole."""
        view = self.view
        return Snapshot(
            town_hash=self.town.content_hash,
            version=STATE_VERSION,
            capacity=view.capacity,
            # as bytes: a copy by fields leaves whatever it likes in the gaps between them
            record=self._record.view(np.uint8).copy().view(self._record.dtype),
            plans=view.plans,
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Puts a saved state back, with its routes.

        Raises:
            ValueError: If it was saved in another town, or with another layout.
        """
        if snapshot.town_hash != self.town.content_hash:
            raise ValueError(
                f"the snapshot was saved in a town with hash {snapshot.town_hash}, this one has "
                f"{self.town.content_hash}; load the town that it was saved in"
            )
        capacity = self._capacity(snapshot.plans)
        if (snapshot.version, snapshot.capacity) != (STATE_VERSION, capacity):
            raise ValueError(
                f"the snapshot has layout {snapshot.version} {snapshot.capacity}, this world has "
                f"{STATE_VERSION} {capacity}; make the world with the same numbers of actors"
            )
        if self._view is None or self._view.plans is not snapshot.plans:
            self._allocate(snapshot.plans)
        self._record.view(np.uint8)[...] = snapshot.record.view(np.uint8)

    def _capacity(self, plans: tuple[RoutePlan, ...]) -> Capacity:
        return capacity_for(self.town, plans, self.config.vehicles, self.config.walkers)

    def _allocate(self, plans: tuple[RoutePlan, ...]) -> None:
        """Makes a fresh record and the kernels' arguments for these plans."""
        capacity = self._capacity(plans)
        if self._view is None or self._view.plans is not plans:  # else as they are
            scenarios = scenario_tables(self.town, plans, capacity.first_scenario_actor)
        else:
            scenarios = self._scenery.scenarios
        self._record = np.zeros(1, state_dtype(capacity))
        self._state = views_of(self._record)
        self._vehicle_end, self._walker_end = capacity.vehicle_end, capacity.walker_end
        self._scenery = build_scenery(self.town, self._tables, plans, scenarios)
        self._advance: Any = None
        read_only = views_of(self._record)
        for array in read_only:
            array.flags.writeable = False
        self._view = WorldView(town=self.town, state=read_only, plans=plans, capacity=capacity)

    def _bind(self) -> None:
        """Makes what only `run` needs: worlds that a vector environment steps have none of it."""
        arguments = self._arguments()
        self._scratch, self._event_rows = arguments[2], arguments[-1]
        self._advance = bind(advance, *arguments)

    def _arguments(self) -> tuple[Any, ...]:
        """Arguments of `advance`, with working memory made for them."""
        capacity = self.view.capacity
        return (
            self._state,
            self._scenery,
            make_scratch(self.town, capacity),
            self._vehicle_end,
            self._walker_end,
            BATCH_TICKS,
            np.zeros((ROWS_PER_EGO * capacity.egos * BATCH_TICKS, COLUMNS)),
        )


def event_of_row(row: NDArray[np.float64]) -> Event:
    """What a row says, (COLUMNS,), as kernels report events."""
    kind, ego, tick, x, y, z, other, value = row.tolist()
    return Event(
        kind=EventKind(int(kind)),
        ego=int(ego),
        tick=int(tick),
        x=x,
        y=y,
        z=z,
        other=int(other),
        value=value,
    )
