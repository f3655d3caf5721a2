"""What gathers while a route is driven: controls, events, trace and hashes.

An agent's drive and its replay keep the same log, so a claim can be compared with what a replay
finds, field by field.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from di_envs.world.state import TICK_S, ActorKind, EventKind
from di_envs.world.world import Event, WorldView
from leaderboard.records.episode_hash import EpisodeHash
from leaderboard.records.record import (
    TRACE_S,
    EventRecord,
    TraceRow,
)

_ACTOR_TYPES: Mapping[int, str] = {
    ActorKind.WALKER: "walker.pedestrian",
    ActorKind.PROP: "static.prop",
    ActorKind.DEBRIS: "static.prop.dirtdebris01",
    ActorKind.VENDING_MACHINE: "static.prop.vendingmachine",
}
_COLLISIONS = frozenset(
    {
        *(EventKind.COLLISION_WALKER, EventKind.COLLISION_VEHICLE, EventKind.COLLISION_STATIC),
        *(EventKind.FIRST_HIT_WALKER, EventKind.FIRST_HIT_VEHICLE, EventKind.FIRST_HIT_STATIC),
    }
)
_TRACE_TICKS = round(TRACE_S / TICK_S)


class EpisodeLog:
    """Controls, events, trace and hashes of one episode, fed decision by decision.

    Attributes:
        hashes: Of observations, rewards and events so far.
        events: What the rules count, so far.
        controls: Every control that was carried out.
    """

    def __init__(self, view: WorldView) -> None:
        """Begins at a reset; `view` is that of the environment, and shows every later moment."""
        self._view = view
        self.hashes = EpisodeHash()
        self.events: list[EventRecord] = []
        self.controls: list[NDArray[np.float32]] = []
        self._trace = [trace_row(view)]

    @property
    def steps(self) -> int:
        """Decisions that were carried out."""
        return len(self.controls)

    def add_step(
        self, control: NDArray[np.float32], reward: float, events: Iterable[Event]
    ) -> None:
        """Adds a decision that was carried out, and what came of it."""
        happened = tuple(events)
        self.controls.append(control.copy())
        self.hashes.add_reward(reward)
        self.hashes.add_events(happened)
        self.hashes.add_state(self._view.state, self._view.ego)
        self.events += [event_record(event, self._view) for event in happened]
        row = trace_row(self._view)
        ticks, last = round(row[0] / TICK_S), round(self._trace[-1][0] / TICK_S)
        if ticks // _TRACE_TICKS > last // _TRACE_TICKS:
            self._trace.append(row)

    def trace(self) -> tuple[TraceRow, ...]:
        """The ego every `TRACE_S` seconds, from the start to the present moment."""
        now = trace_row(self._view)
        return tuple(self._trace if self._trace[-1] == now else [*self._trace, now])

    def control_array(self) -> NDArray[np.float32]:
        """(N, 3) controls so far."""
        return np.array(self.controls, np.float32).reshape(-1, 3)


def trace_row(view: WorldView) -> TraceRow:
    """Where the ego is now: time [s], x, y, z [m], yaw [rad], speed [m/s], to the millimetre."""
    state, ego = view.state, view.ego
    values = (state.x, state.y, state.z, state.yaw, state.speed)
    x, y, z, yaw, speed = (round(float(value[ego]), 3) + 0.0 for value in values)  # no -0.0
    return (round(int(state.tick) * TICK_S, 6), x, y, z, yaw, speed)


def event_record(event: Event, view: WorldView) -> EventRecord:
    """The event with its time, and what it met in CARLA's words."""
    collision = event.kind in _COLLISIONS
    other = int(view.state.kind[event.other]) if collision and event.other >= 0 else 0
    default = f"vehicle.{ActorKind(other).name.lower()}" if other else ""
    return EventRecord(
        kind=EventKind(event.kind),
        tick=int(event.tick),
        time_s=round(event.tick * TICK_S, 6),
        x=float(event.x),
        y=float(event.y),
        z=float(event.z),
        other=int(event.other),
        other_type=_ACTOR_TYPES.get(other, default),
        value=float(event.value),
    )
