"""Who hides whom from the car: lines of sight past vehicles and buildings, as kernels.

A line of sight goes from the driver's eye to what sticks up highest of somebody, so a car hides
nobody who stands behind it and a van does. World frame, metres.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Float64, Int32
from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.sensors.scene.scene import scene_of
from di_envs.sensors.scene.tags import Tag
from di_envs.town.town import Town
from di_envs.world.state import ActorKind, State

EYE_M = 1.6  # above the ground below the car's middle
TOP_SHARE = 0.9  # of somebody's height: so much of him is seen when this is
SIDE_SHARE = 0.8  # of his half width, where the lines to his two sides end
THIN_M = 0.3  # half width below which nothing hides anybody: people, poles

_ABSENT, _DEBRIS = int(ActorKind.ABSENT), int(ActorKind.DEBRIS)


@by_reference
class Buildings(NamedTuple):
    """What stands beside roads and hides who is behind it (B)."""

    x: Float64
    y: Float64
    yaw: Float64
    half_length: Float64
    half_width: Float64
    top_m: Float64  # height of its top, world frame


def buildings_of(town: Town) -> Buildings:
    """The buildings that cameras and LiDAR see in a town."""
    boxes = scene_of(town).boxes
    rows = np.flatnonzero(boxes.tag == int(Tag.BUILDINGS))
    half = boxes.half[rows].astype(np.float64)
    return Buildings(
        x=boxes.centre[rows, 0].copy(),
        y=boxes.centre[rows, 1].copy(),
        yaw=boxes.yaw[rows].astype(np.float64),
        half_length=half[:, 0].copy(),
        half_width=half[:, 1].copy(),
        top_m=boxes.centre[rows, 2] + half[:, 2],
    )


@kernel
def collect_hiders(
    state: State, buildings: Buildings, ego: int, range_m: float, bodies: Int32, walls: Int32
) -> tuple[int, int]:
    """Who and what near a car is broad enough to hide somebody.

    Args:
        state: The world.
        buildings: Of the town.
        ego: The car that looks.
        range_m: How far it looks.
        bodies: (A,) filled with actors.
        walls: (B,) filled with buildings.

    Returns:
        How many of each.
    """
    kind, xs, ys, half_width = state.kind, state.x, state.y, state.half_width
    x, y, n, m = xs[ego], ys[ego], 0, 0
    for actor in range(kind.size):
        if actor == ego or kind[actor] == _ABSENT or kind[actor] == _DEBRIS:
            continue
        dx, dy = xs[actor] - x, ys[actor] - y
        if half_width[actor] >= THIN_M and dx * dx + dy * dy < range_m * range_m:
            bodies[n] = actor
            n += 1
    wall_x, wall_y = buildings.x, buildings.y
    wall_length, wall_width = buildings.half_length, buildings.half_width
    for wall in range(wall_x.size):
        reach = range_m + wall_length[wall] + wall_width[wall]
        dx, dy = wall_x[wall] - x, wall_y[wall] - y
        if dx * dx + dy * dy < reach * reach:
            walls[m] = wall
            m += 1
    return n, m


@kernel
def is_hidden(
    state: State, buildings: Buildings, ego: int, actor: int, bodies: Int32, walls: Int32
) -> bool:
    """Whether every line of sight from a car to somebody is blocked.

    Args:
        state: The world.
        buildings: Of the town.
        ego: The car that looks.
        actor: Whom it looks for.
        bodies: Actors that may hide him, from `collect_hiders`.
        walls: Buildings that may.
    """
    dx, dy = state.x[actor] - state.x[ego], state.y[actor] - state.y[ego]
    distance = math.hypot(dx, dy)
    if distance < 1e-6:
        return False
    turn = state.yaw[actor] - math.atan2(dy, dx)
    breadth = abs(state.half_length[actor] * math.sin(turn))
    breadth = SIDE_SHARE * (breadth + abs(state.half_width[actor] * math.cos(turn)))
    for side in (0.0, -1.0, 1.0):
        aside = side * breadth / distance
        to_x, to_y = dx - aside * dy, dy + aside * dx
        if not _is_blocked(state, buildings, ego, actor, to_x, to_y, bodies, walls):
            return False
    return True


@kernel
def _is_blocked(
    state: State,
    buildings: Buildings,
    ego: int,
    actor: int,
    to_x: float,
    to_y: float,
    bodies: Int32,
    walls: Int32,
) -> bool:
    """Whether the line from the car's eye to (to_x, to_y), relative to it, meets a body or wall."""
    eye = state.z[ego] + EYE_M
    rise = state.z[actor] + TOP_SHARE * state.height[actor] - eye
    for other in bodies:
        if other == actor:
            continue
        near, far = _stretch_in_box(
            state.x[other] - state.x[ego],
            state.y[other] - state.y[ego],
            state.yaw[other],
            state.half_length[other],
            state.half_width[other],
            to_x,
            to_y,
        )
        if near < far:
            low, high = eye + rise * near, eye + rise * far
            base = state.z[other]
            if min(low, high) < base + state.height[other] and max(low, high) > base:
                return True
    for wall in walls:
        near, far = _stretch_in_box(
            buildings.x[wall] - state.x[ego],
            buildings.y[wall] - state.y[ego],
            buildings.yaw[wall],
            buildings.half_length[wall],
            buildings.half_width[wall],
            to_x,
            to_y,
        )
        if near < far and min(eye + rise * near, eye + rise * far) < buildings.top_m[wall]:
            return True
    return False


@kernel
def _stretch_in_box(
    x: float, y: float, yaw: float, half_length: float, half_width: float, to_x: float, to_y: float
) -> tuple[float, float]:
    """Shares of a line from the origin to (to_x, to_y) between which it lies in a box.

    The first is not less than the second where it does not.
    """
    square = to_x * to_x + to_y * to_y
    reach = half_length + half_width
    across = to_x * y - to_y * x
    along = to_x * x + to_y * y
    if (
        across * across > reach * reach * square
        or along < 0.0
        or (along > square + reach * math.sqrt(square))
    ):
        return 1.0, 0.0
    cos, sin = math.cos(yaw), math.sin(yaw)
    near, far = 0.0, 1.0
    for axis in range(2):
        if axis == 0:
            step, start, half = cos * to_x + sin * to_y, -(cos * x + sin * y), half_length
        else:
            step, start, half = cos * to_y - sin * to_x, -(cos * y - sin * x), half_width
        if abs(step) < 1e-9:
            if abs(start) > half:
                return 1.0, 0.0
            continue
        a, b = (-half - start) / step, (half - start) / step
        near, far = max(near, min(a, b)), min(far, max(a, b))
    return near, far
