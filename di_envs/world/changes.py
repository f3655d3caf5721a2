"""Changes that no tick makes: an actor taken away or set down elsewhere, a light forced.

They are for asking what would have happened; all that depends on what changed is set anew, so the
world goes on from there as from any other state.
"""

from __future__ import annotations

import math

import numpy as np

from di_envs.town.lanes import Lanes, LightState, SignalKind, Signals
from di_envs.town.queries import nearest_driving_lane_towards, pose_at, project_to_lane
from di_envs.world.lights import show_lights
from di_envs.world.state import ActorKind, State
from di_envs.world.struck import take_away
from di_envs.world.traffic.motion import choose_path, place_vehicle
from di_envs.world.traffic.tables import TrafficTables
from di_envs.world.walkers.on_edges import place_on_edge
from di_envs.world.walkers.walk_graph import WalkGraph

REACH_M = 3.0  # from a lane or way, within which an actor is set down on it
LEVEL_M = 3.0
_NEAREST = 5  # actors that a refusal names


class ChangeError(ValueError):
    """A change that cannot be made in this world; the message says why and what could be."""


def remove_actor(state: State, actor: int) -> None:
    """Takes an actor away for the rest of the episode. What an ego has done still counts."""
    check_actor(state, actor)
    take_away(state, actor)
    if actor < state.throttle.size:
        state.occupied[actor] = -1


def check_actor(state: State, actor: int) -> None:
    """Refuses an actor that is not there.

    Raises:
        ChangeError: With the actors nearest to the first ego.
    """
    if 0 <= actor < state.kind.size and state.kind[actor] != ActorKind.ABSENT:
        return
    here = np.flatnonzero((state.kind != ActorKind.ABSENT) & (state.kind < ActorKind.PROP))
    here = here[here >= state.throttle.size]
    distance = np.hypot(state.x[here] - state.x[0], state.y[here] - state.y[0])
    near = np.argsort(distance, kind="stable")[:_NEAREST]
    names = ", ".join(
        f"{here[k]} ({ActorKind(int(state.kind[here[k]])).name.lower()}, {distance[k]:.0f} m)"
        for k in near
    )
    raise ChangeError(f"there is no actor {actor} at this moment; nearest to the ego: {names}")


def move_vehicle_to(
    state: State, lanes: Lanes, tables: TrafficTables, actor: int, x: float, y: float
) -> None:
    """Sets a vehicle down in the middle of the lane at (x, y) [m] that leads its way.

    It keeps its speed and draws a new way.

    Raises:
        ChangeError: If there is no such lane within `REACH_M`, it is in a junction, or somebody
            else is there.
    """
    z, yaw = float(state.z[actor]), float(state.yaw[actor])
    lane = int(nearest_driving_lane_towards(lanes, x, y, z, yaw, REACH_M)[0])
    station = float(project_to_lane(lanes, lane, x, y)[0]) if lane >= 0 else 0.0
    leads = lane >= 0 and math.cos(pose_at(lanes, lane, station)[3] - yaw) > 0.0
    if not leads or lanes.junction[lane] >= 0 or not tables.usable[lane]:
        raise ChangeError(
            f"no lane outside junctions leads the way of actor {actor} within {REACH_M:g} m of "
            f"({x:.1f}, {y:.1f}): move it by other distances"
        )
    before = [getattr(state, name)[actor].copy() for name in _VEHICLE_FIELDS]
    state.lane[actor] = lane
    state.lane_m[actor] = station
    state.lateral_m[actor] = 0.0
    for name in ("path", "previous_lane", "earlier_lanes", "changing_from", "grant"):
        getattr(state, name)[actor] = -1
    for name in ("arrival_tick", "stopped_at"):
        getattr(state, name)[actor] = -1
    state.still_ticks[actor] = state.grant_steps[actor] = 0
    state.path[actor, 0] = lane
    choose_path(state, lanes, tables, actor, 1)
    place_vehicle(state, lanes, actor)
    try:
        _check_free(state, actor)
    except ChangeError:
        for name, value in zip(_VEHICLE_FIELDS, before, strict=True):
            getattr(state, name)[actor] = value
        raise


_VEHICLE_FIELDS = (
    *("x", "y", "z", "yaw", "lane", "lane_m", "lateral_m", "path", "previous_lane"),
    *("earlier_lanes", "changing_from", "grant", "grant_steps", "arrival_tick", "stopped_at"),
    "still_ticks",
)


def move_walker_to(state: State, walk: WalkGraph, actor: int, x: float, y: float) -> None:
    """Sets a walker down on the way nearest to (x, y) [m]; it keeps its direction along it.

    Raises:
        ChangeError: If there is no way within `REACH_M`.
    """
    level = np.abs(walk.points[:, 2] - state.z[actor]) < LEVEL_M
    distance = np.where(level, np.hypot(walk.points[:, 0] - x, walk.points[:, 1] - y), math.inf)
    point = int(np.argmin(distance))
    if not distance[point] <= REACH_M:
        raise ChangeError(
            f"nobody walks within {REACH_M:g} m of ({x:.1f}, {y:.1f}): move it by other distances"
        )
    edge = int(np.searchsorted(walk.first, point, side="right") - 1)
    station = float((point - walk.first[edge]) * walk.spacing_m[edge])
    state.walk_edge[actor], state.walk_m[actor] = edge, station
    state.walk_waiting[actor] = 0
    state.still_ticks[actor] = 0
    place = place_on_edge(walk, edge, station, state.walk_direction[actor])
    state.x[actor], state.y[actor], state.z[actor], state.yaw[actor] = place


def force_light(state: State, signals: Signals, light: int, shows: LightState) -> None:
    """Makes a light show one state from now on; NONE gives it back to its turn.

    Args:
        state: The world.
        signals: The town's signals.
        light: Index of the signal, as events name it.
        shows: What it shows.

    Raises:
        ChangeError: If there is no such light; lists those near the first ego.
    """
    if not (0 <= light < signals.kind.size and signals.kind[light] == SignalKind.LIGHT):
        lights = np.flatnonzero(signals.kind == SignalKind.LIGHT)
        place = signals.pose[lights, :2] - (state.x[0], state.y[0])
        near = lights[np.argsort(np.hypot(*place.T), kind="stable")[:_NEAREST]]
        raise ChangeError(
            f"there is no light {light} in this town; nearest to the ego: "
            f"{', '.join(map(str, near.tolist()))}"
        )
    state.forced_light[light] = shows
    show_lights(state, signals)


def _check_free(state: State, actor: int) -> None:
    """Refuses a place where a vehicle would stand in another actor."""
    others = np.flatnonzero((state.kind != ActorKind.ABSENT) & (state.kind != ActorKind.DEBRIS))
    others = others[(others != actor) & (np.abs(state.z[others] - state.z[actor]) < LEVEL_M)]
    dx, dy = state.x[others] - state.x[actor], state.y[others] - state.y[actor]
    turn, yaw = state.yaw[others] - state.yaw[actor], state.yaw[actor]
    cos, sin = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    length, width = state.half_length[others], state.half_width[others]
    # Boxes in the actor's axes that hold the others: a little more than needed, never less.
    met = np.abs(math.cos(yaw) * dx + math.sin(yaw) * dy) < (
        state.half_length[actor] + cos * length + sin * width
    )
    met &= np.abs(math.cos(yaw) * dy - math.sin(yaw) * dx) < (
        state.half_width[actor] + sin * length + cos * width
    )
    if met.any():
        raise ChangeError(
            f"actor {actor} would stand in actor {int(others[met][0])} there: move it by other "
            f"distances, or remove that one first"
        )
