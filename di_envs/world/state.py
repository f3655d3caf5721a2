"""The world's state as a value: one contiguous record a world, with named fields.

Everything that time changes is here, so that to save, hash or branch a world is to copy a row.
Actors (axis A) have stable ids: the egos first [0, E), then vehicles, then walkers, poles and
those of scenarios, each with a slot of its own. G counts all egos' scenario triggers, in a row.
World frame, SI units; stations are along the lane in its direction of travel.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.world.kinds import TICK_S as TICK_S
from di_envs.world.kinds import ActorKind as ActorKind
from di_envs.world.kinds import EventKind as EventKind

PATH_LANES = 10  # lanes ahead that a vehicle has chosen, its own first
TAIL_LANES = 6  # lanes remembered behind the one that a vehicle has left last
SPEED_HISTORY = 4  # past speeds in an observation, at 0.5 s, 1 s, …
HISTORY_TICKS = 10  # ticks between two of them
HISTORY_LENGTH = SPEED_HISTORY * HISTORY_TICKS + 1
OCCUPIED_LANES = 4  # lanes that a free body (an ego, a walker) may lie on at once
COLLISION_MEMORY = 8  # remembered collision places
EVENT_KINDS = max(EventKind) + 1  # columns of `counts`
CHECKPOINTS = 4  # along a route, at which the ego's mean speed is compared with the traffic's


@by_reference
class State(NamedTuple):
    """Views into one world's record; see `state_dtype` for shapes and meanings."""

    seed: NDArray[np.uint64]  # ()
    tick: NDArray[np.int64]  # ()
    # actors (A,)
    kind: NDArray[np.int8]  # ActorKind
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]  # of the ground below the actor
    yaw: NDArray[np.float64]
    speed: NDArray[np.float64]  # m/s along yaw
    acceleration: NDArray[np.float64]  # m/s2 along yaw, of the last tick
    yaw_rate: NDArray[np.float64]  # rad/s
    half_length: NDArray[np.float64]  # m
    half_width: NDArray[np.float64]  # m
    height: NDArray[np.float64]  # m
    lane: NDArray[np.int32]  # driving lane that the actor is on (nearest one for egos), -1 for none
    lane_m: NDArray[np.float64]  # station of the actor's centre on it
    lateral_m: NDArray[np.float64]  # offset from the lane's centre, positive to the right
    # vehicles (A,), unused by the rest
    path: NDArray[np.int32]  # (A, PATH_LANES) lanes ahead, own lane first, -1 at the end
    previous_lane: NDArray[
        np.int32
    ]  # the lane left last (its tail may still be on it), -1 for none
    earlier_lanes: NDArray[np.int32]  # (A, TAIL_LANES) lanes left before that one, the last first
    changing_from: NDArray[np.int32]  # lane that a lane change leaves, -1 when none is under way
    change_start_tick: NDArray[np.int64]
    grant: NDArray[np.int32]  # junction lane that the vehicle may enter or is on, -1 for none
    grant_steps: NDArray[np.int32]  # lanes of its path ahead, behind its own, that it may drive on
    grant_tick: NDArray[np.int64]  # when that was last given
    arrival_tick: NDArray[np.int64]  # when it came to the stop line it waits at, -1 for none
    stopped_at: NDArray[np.int32]  # stop line at which it has stopped for the sign, -1 for none
    still_ticks: NDArray[np.int32]  # ticks for which it has stood still, or a walker got nowhere
    shock_ticks: NDArray[np.int32]  # ticks that one who was hit will still stand, 0 for none
    away: NDArray[np.int8]  # ActorKind as which one comes back who left by an open end, 0 for none
    desired_factor: NDArray[np.float64]  # of the speed limit, per driver
    brake_light: NDArray[np.int8]
    indicator: NDArray[np.int8]  # -1 left, 0 off, 1 right
    # walkers (A,), unused by the rest
    walk_edge: NDArray[np.int32]  # edge of the walking graph
    walk_m: NDArray[np.float64]  # station along it
    walk_direction: NDArray[np.int8]  # 1 along the edge, -1 against
    walk_waiting: NDArray[np.int8]  # 1 while waiting at a kerb, 2 (DOWN) for who was knocked down
    walk_side: NDArray[np.int8]  # to which one goes round others: 1 right, -1 left, 0 none yet
    # lights: (J,) junctions, (S,) signal heads
    phase_group: NDArray[np.int32]  # group whose turn it is
    phase_ticks: NDArray[np.int32]  # ticks since its green began
    light: NDArray[np.int8]  # (S,) LightState
    forced_light: NDArray[np.int8]  # (S,) LightState shown whatever the turn, NONE for the turn's
    held_by: NDArray[np.int32]  # (J,) 1 + trigger that plays with its lights, 0 for none
    held_until: NDArray[np.int64]  # (J,) tick at which a forced yellow ends
    # egos (E,): controls and progress
    throttle: NDArray[np.float64]  # held control, 0..1
    steer: NDArray[np.float64]  # held control, -1..1, positive right
    brake: NDArray[np.float64]  # held control, 0..1
    wheel: NDArray[np.float64]  # steering that the actuator has reached, -1..1
    throttle_noise: NDArray[np.float64]  # added to the held control while control is lost
    steer_noise: NDArray[np.float64]
    speed_history: NDArray[np.float64]  # (E, HISTORY_LENGTH) ring of speeds by tick
    route_index: NDArray[np.int32]  # route point reached
    route_done_m: NDArray[np.float64]  # metres of the dense route completed
    target_index: NDArray[np.int32]  # next target point, an index into the plan's targets
    occupied: NDArray[
        np.int32
    ]  # (E, OCCUPIED_LANES) driving lanes below the ego's box, -1 for none
    finished: NDArray[np.int8]  # EventKind that ended the route, 0 while it goes on
    nearest_index: NDArray[np.int32]  # route point nearest the ego, which triggers scenarios
    # egos (E,): what the events remember
    last_collision_actor: NDArray[np.int32]
    last_collision_tick: NDArray[np.int64]
    collision_places: NDArray[np.float64]  # (E, COLLISION_MEMORY, 2), NaN for none
    contact_tick: NDArray[np.int64]  # (E, A) last tick at which the ego touched a body, 0 for none
    hit: NDArray[np.int8]  # (E, A) 1: the ego has touched it, 2: and this contact was counted
    last_red_signal: NDArray[np.int32]
    last_wide_signal: NDArray[np.int32]  # the same by the whole stop line
    stop_target: NDArray[np.int32]  # stop sign being watched, -1 for none
    stop_done: NDArray[np.int8]  # the ego stopped for it
    stop_affected: NDArray[np.int8]  # the ego was in its box
    outside_lane: NDArray[np.int8]
    wrong_lane: NDArray[np.int8]
    lane_before: NDArray[np.int32]  # lane at the last tick, for the wrong-way test
    lane_before_yaw: NDArray[np.float64]  # that lane's direction where the ego was
    outside_m: NDArray[np.float64]  # route metres outside lanes or against them
    outside_done_m: NDArray[np.float64]  # route metres over which they were counted
    outside_index: NDArray[np.int32]  # route point up to which they were counted
    deviation_index: NDArray[np.int32]  # route point that the deviation test follows
    deviation_m: NDArray[np.float64]  # route progress made while more than 15 m off
    blocked_ticks: NDArray[np.int32]
    counts: NDArray[np.int32]  # (E, EVENT_KINDS) events so far, by EventKind
    pace_from_m: NDArray[np.float64]  # route metres done at the last checkpoint
    pace_ego: NDArray[np.float64]  # sum of its speed [m/s] since then, over ticks with traffic near
    pace_traffic: NDArray[np.float64]  # sum of the mean speed of the traffic near it
    checkpoint: NDArray[np.int32]  # checkpoints so far
    pace_share: NDArray[np.float64]  # (E, CHECKPOINTS) ego's share of the traffic's pace, up to 1
    # scenarios (G,)
    scenario_step: NDArray[np.int8]  # AHEAD, then the steps of its family, then DONE
    scenario_tick: NDArray[np.int64]  # at which that step began
    scenario_m: NDArray[np.float64]  # how far its walker or cyclist has crossed


class Capacity(NamedTuple):
    """How many there can be of each; fixes the layout of the record."""

    egos: int
    vehicles: int
    walkers: int
    props: int
    junctions: int
    signals: int
    triggers: int = 0
    scenario_actors: int = 0

    @property
    def actors(self) -> int:
        return self.first_scenario_actor + self.scenario_actors

    @property
    def vehicle_end(self) -> int:
        """First actor id behind the vehicles: that of the first walker."""
        return self.egos + self.vehicles

    @property
    def walker_end(self) -> int:
        """First actor id behind the walkers: that of the first pole."""
        return self.vehicle_end + self.walkers

    @property
    def first_scenario_actor(self) -> int:
        return self.walker_end + self.props


_F8, _I8, _I4, _I1, _U8 = "f8", "i8", "i4", "i1", "u8"


@cache
def state_dtype(capacity: Capacity) -> np.dtype[np.void]:
    """The record of one world; field order is that of `State`."""
    actors, egos, triggers = (capacity.actors,), (capacity.egos,), (capacity.triggers,)
    shapes: dict[str, tuple[str, tuple[int, ...]]] = {
        "seed": (_U8, ()),
        "tick": (_I8, ()),
        "kind": (_I1, actors),
        **dict.fromkeys(("x", "y", "z", "yaw", "speed", "acceleration", "yaw_rate"), (_F8, actors)),
        **dict.fromkeys(("half_length", "half_width", "height"), (_F8, actors)),
        "lane": (_I4, actors),
        **dict.fromkeys(("lane_m", "lateral_m"), (_F8, actors)),
        "path": (_I4, (*actors, PATH_LANES)),
        "previous_lane": (_I4, actors),
        "earlier_lanes": (_I4, (*actors, TAIL_LANES)),
        "changing_from": (_I4, actors),
        "change_start_tick": (_I8, actors),
        **dict.fromkeys(("grant", "grant_steps"), (_I4, actors)),
        **dict.fromkeys(("grant_tick", "arrival_tick"), (_I8, actors)),
        **dict.fromkeys(("stopped_at", "still_ticks", "shock_ticks"), (_I4, actors)),
        "away": (_I1, actors),
        "desired_factor": (_F8, actors),
        **dict.fromkeys(("brake_light", "indicator"), (_I1, actors)),
        "walk_edge": (_I4, actors),
        "walk_m": (_F8, actors),
        **dict.fromkeys(("walk_direction", "walk_waiting", "walk_side"), (_I1, actors)),
        **dict.fromkeys(("phase_group", "phase_ticks"), (_I4, (capacity.junctions,))),
        **dict.fromkeys(("light", "forced_light"), (_I1, (capacity.signals,))),
        "held_by": (_I4, (capacity.junctions,)),
        "held_until": (_I8, (capacity.junctions,)),
        **dict.fromkeys(("throttle", "steer", "brake", "wheel"), (_F8, egos)),
        **dict.fromkeys(("throttle_noise", "steer_noise"), (_F8, egos)),
        "speed_history": (_F8, (*egos, HISTORY_LENGTH)),
        "route_index": (_I4, egos),
        "route_done_m": (_F8, egos),
        "target_index": (_I4, egos),
        "occupied": (_I4, (*egos, OCCUPIED_LANES)),
        "finished": (_I1, egos),
        "nearest_index": (_I4, egos),
        "last_collision_actor": (_I4, egos),
        "last_collision_tick": (_I8, egos),
        "collision_places": (_F8, (*egos, COLLISION_MEMORY, 2)),
        "contact_tick": (_I8, (*egos, *actors)),
        "hit": (_I1, (*egos, *actors)),
        **dict.fromkeys(("last_red_signal", "last_wide_signal", "stop_target"), (_I4, egos)),
        **dict.fromkeys(("stop_done", "stop_affected", "outside_lane", "wrong_lane"), (_I1, egos)),
        "lane_before": (_I4, egos),
        "lane_before_yaw": (_F8, egos),
        **dict.fromkeys(("outside_m", "outside_done_m"), (_F8, egos)),
        **dict.fromkeys(("outside_index", "deviation_index"), (_I4, egos)),
        "deviation_m": (_F8, egos),
        "blocked_ticks": (_I4, egos),
        "counts": (_I4, (*egos, EVENT_KINDS)),
        "pace_from_m": (_F8, egos),
        **dict.fromkeys(("pace_ego", "pace_traffic"), (_F8, egos)),
        "checkpoint": (_I4, egos),
        "pace_share": (_F8, (*egos, CHECKPOINTS)),
        "scenario_step": (_I1, triggers),
        "scenario_tick": (_I8, triggers),
        "scenario_m": (_F8, triggers),
    }
    return np.dtype([(name, *shapes[name]) for name in State._fields], align=True)


def views_of(record: NDArray[np.void]) -> State:
    """Named views into a world's record, a one-element array: they share its memory."""
    state: Any = _views(record)
    if record.flags.aligned:  # as all are that were made here
        first = _first_of(record.dtype)
        state.lie_as(first, state.seed.ctypes.data - first.seed.ctypes.data)
    views: State = state
    return views


@cache
def _first_of(layout: np.dtype[np.void]) -> State:
    """Views into a record of a layout, after which those into all others are described."""
    return _views(np.zeros(1, layout))


def _views(record: NDArray[np.void]) -> State:
    return State(
        *(
            record[name][0] if record[name].ndim > 1 else record[name].reshape(())
            for name in State._fields
        )
    )


@by_reference
class Routes(NamedTuple):
    """The egos' plans for kernels, in a row: ego e has points [start[e], start[e + 1])."""

    start: NDArray[np.int32]  # (E + 1,)
    points: NDArray[np.float64]  # (R, 4) x, y, z, yaw
    option: NDArray[np.int8]  # (R,) RoadOption
    lane: NDArray[np.int32]  # (R,)
    lane_m: NDArray[np.float64]  # (R,)
    route_m: NDArray[np.float64]  # (R,) from 0 for each ego
    target_start: NDArray[np.int32]  # (E + 1,)
    target: NDArray[np.int32]  # (T,) indices of target points, counted within each ego's own route
    timeout_s: NDArray[np.float64]  # (E,)
