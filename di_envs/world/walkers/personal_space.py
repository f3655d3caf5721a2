"""Walkers keep out of each other's way: nobody steps into another, and who meets steps aside.

Who finds somebody in his way goes round him, to the right if there is room and else to the left,
and stays on that side until the way is free: so two who meet both step to their right, and pass.
"""

from __future__ import annotations

import math

from di_envs.numerics.kernels import kernel
from di_envs.world.bodies import SAME_LEVEL_M
from di_envs.world.state import State
from di_envs.world.walkers.crossing import is_blocked
from di_envs.world.walkers.neighbours import Neighbours, cell_of, cells_around
from di_envs.world.walkers.on_edges import Place
from di_envs.world.walkers.walk_graph import WalkGraph

CLEAR_M = 0.75  # between two middles: more than the diagonal of a body's square, 0.71
TURN_RAD = 0.52  # by which a step aside turns away, once, twice or three times
TURNS = 3


@kernel
def step_is_free(state: State, near: Neighbours, walker: int, x: float, y: float) -> bool:
    """Whether a walker may step to (x, y): it comes near nobody, or leads away from who is near."""
    here_x, here_y = state.x[walker], state.y[walker]
    xs, ys = state.x, state.y
    left, right, top, bottom = cells_around(x, y)
    for row in range(top, bottom):
        for column in range(left, right):
            other = near.first[cell_of(column, row)]
            while other >= 0:
                dx, dy = xs[other] - x, ys[other] - y
                after = dx * dx + dy * dy
                if after < CLEAR_M * CLEAR_M and other != walker:
                    dx, dy = xs[other] - here_x, ys[other] - here_y
                    level = abs(state.z[other] - state.z[walker]) < SAME_LEVEL_M
                    if after < dx * dx + dy * dy and level:
                        return False
                other = near.next[other]
    return True


@kernel
def _beyond(walk: WalkGraph, edge: int, lateral_m: float) -> float:
    """How far a place beside an edge's line, to its right, is outside where one may walk [m]."""
    return max(lateral_m - walk.right_m[edge], -walk.left_m[edge] - lateral_m, 0.0)


@kernel
def _is_on_way(
    state: State, walk: WalkGraph, walker: int, x: float, y: float, guide: Place
) -> bool:
    """Whether (x, y) is beside the edge's line where one may walk, or no further from there."""
    edge, direction = state.walk_edge[walker], state.walk_direction[walker]
    lateral = walk.forth_m[edge] if direction > 0 else walk.back_m[edge]
    right_x, right_y = -direction * math.sin(guide[3]), direction * math.cos(guide[3])
    here_x, here_y = state.x[walker] - guide[0], state.y[walker] - guide[1]
    here = lateral + here_x * right_x + here_y * right_y
    there = lateral + (x - guide[0]) * right_x + (y - guide[1]) * right_y
    return _beyond(walk, edge, there) <= _beyond(walk, edge, here)


@kernel
def step_aside(
    state: State,
    walk: WalkGraph,
    near: Neighbours,
    walker: int,
    reach_m: float,
    guide: Place,
    on_road: bool,
) -> bool:
    """Moves a walker by `reach_m` beside the straight way to `guide`, where there is room.

    Args:
        state: The world; the walker's place and `walk_side` change.
        walk: The walking graph.
        near: Who is where.
        walker: Who steps aside.
        reach_m: Length of the step.
        guide: Where he is bound: x, y, z, yaw.
        on_road: Whether vehicles besides egos may be in the way.

    Returns:
        Whether he could.
    """
    here_x, here_y, z = state.x[walker], state.y[walker], state.z[walker]
    ahead = math.atan2(guide[1] - here_y, guide[0] - here_x)
    side = -1 if state.walk_side[walker] < 0 else 1  # to the right, as yaw turns
    for _ in range(2):
        for k in range(TURNS):
            heading = ahead + side * (k + 1) * TURN_RAD
            x, y = here_x + reach_m * math.cos(heading), here_y + reach_m * math.sin(heading)
            if not step_is_free(state, near, walker, x, y):
                continue
            if not _is_on_way(state, walk, walker, x, y, guide):
                continue
            if is_blocked(state, near, on_road, here_x, here_y, z, heading, reach_m, 0.0):
                continue
            state.x[walker], state.y[walker] = x, y
            state.walk_side[walker] = side
            return True
        side = -side
    return False
