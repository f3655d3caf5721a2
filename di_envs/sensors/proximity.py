"""What an ego touches, what stands close ahead of it, and whether it lies across a lane's edge.

The facts behind CARLA's sensors of events: collision, obstacle, lane invasion. Pure functions of
the state, without noise, as those are.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.arrays import Float32, Int8
from di_envs.town.lanes import Lanes
from di_envs.world.kinds import ActorKind
from di_envs.world.state import State

CONTACTS = 8  # bodies that are listed, by their ids
AHEAD_M = 50.0  # how far ahead obstacles are looked for
WIDER_M = 0.5  # on each side: CARLA's hit radius


def proximity_of(state: State, lanes: Lanes, ego: int) -> dict[str, NDArray[Any]]:
    """`contacts`, `obstacle` and `across_line`; see the functions below."""
    return {
        "contacts": contacts_of(state, ego),
        "obstacle": obstacle_of(state, ego),
        "across_line": across_line_of(state, lanes, ego),
    }


def contacts_of(state: State, ego: int) -> Float32:
    """(CONTACTS, 4) bodies that an ego touches: id + 1, `ActorKind`, x ahead, y right [m].

    Rows of zeros for none.
    """
    rows = np.zeros((CONTACTS, 4), np.float32)
    tick = int(state.tick)
    touched = np.flatnonzero((state.contact_tick[ego] == tick) & (tick > 0))[:CONTACTS]
    x, y = _in_ego(state, ego, touched)
    rows[: len(touched)] = np.stack([touched + 1.0, state.kind[touched], x, y], axis=1)
    return rows


def obstacle_of(state: State, ego: int) -> Float32:
    """(3,) the nearest body straight ahead: id + 1, `ActorKind`, metres from the ego's middle.

    Bodies count that reach into a strip 2 * WIDER_M wide, AHEAD_M long; zeros for none.
    """
    others = np.flatnonzero(state.kind != ActorKind.ABSENT)
    others = others[others != ego]
    x, y = _in_ego(state, ego, others)
    turn = state.yaw[others] - state.yaw[ego]
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    half_x = c * state.half_length[others] + s * state.half_width[others]
    half_y = s * state.half_length[others] + c * state.half_width[others]
    far = x - half_x
    met = (np.abs(y) < half_y + WIDER_M) & (x > 0.0) & (far < AHEAD_M)
    if not met.any():
        return np.zeros(3, np.float32)
    first = int(np.flatnonzero(met)[far[met].argmin()])
    actor = int(others[first])
    return np.array([actor + 1, state.kind[actor], max(float(far[first]), 0.0)], np.float32)


def across_line_of(state: State, lanes: Lanes, ego: int) -> Int8:
    """(1,) 1 while an ego's box lies across an edge of the lane that it is on, else 0.

    By its middle's offset and how it is turned on the lane. Inside junctions, where no lines are
    painted, and off the lanes it is 0.
    """
    lane = int(state.lane[ego])
    if lane < 0 or lanes.junction[lane] >= 0:
        return np.zeros(1, np.int8)
    share = float(state.lane_m[ego]) / float(lanes.spacing_m[lane])
    point = int(lanes.first[lane]) + min(max(round(share), 0), int(lanes.count[lane]) - 1)
    turn = float(state.yaw[ego]) - float(lanes.points[point, 3])
    half_m = abs(math.cos(turn)) * float(state.half_width[ego])
    half_m += abs(math.sin(turn)) * float(state.half_length[ego])
    over_m = abs(float(state.lateral_m[ego])) + half_m - 0.5 * float(lanes.width_m[point])
    return np.array([over_m > 0.0], np.int8)


def _in_ego(
    state: State, ego: int, actors: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Metres ahead of and right of an ego at which actors are."""
    dx, dy = state.x[actors] - state.x[ego], state.y[actors] - state.y[ego]
    c, s = math.cos(state.yaw[ego]), math.sin(state.yaw[ego])
    return c * dx + s * dy, c * dy - s * dx
