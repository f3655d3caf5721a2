"""Where on an edge of the walking graph somebody is: his guide ahead, his body behind it.

A walker's guide `walk_m` goes on along the edge's line and his body comes after, so that it can go
round others; the body decides who is on a crosswalk.
"""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Int8
from di_envs.numerics.kernels import kernel
from di_envs.world.state import ActorKind, State
from di_envs.world.walkers.crossing import BODY_M
from di_envs.world.walkers.walk_graph import WalkGraph

Place = tuple[float, float, float, float]  # x, y, z [m], yaw [rad], world frame

KERB_M = 1.0  # from the driving lane at which walkers wait: long vehicles swing out that far

WALKER = int(ActorKind.WALKER)


@kernel
def place_on_edge(walk: WalkGraph, edge: int, station: float, direction: int) -> Place:
    """Where somebody walks who goes in `direction` at a station: (x, y, z, yaw)."""
    step = station / walk.spacing_m[edge]
    k = min(max(int(step), 0), walk.size[edge] - 2)
    part = step - k
    a, b = walk.points[walk.first[edge] + k], walk.points[walk.first[edge] + k + 1]
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    side = walk.forth_m[edge] if direction > 0 else walk.back_m[edge]
    side /= max(math.sqrt(dx * dx + dy * dy), 1e-9)
    yaw = a[3]  # in [-pi, pi]
    if direction < 0:
        yaw += math.pi if yaw < 0.0 else -math.pi
    return a[0] + part * dx - side * dy, a[1] + part * dy + side * dx, a[2] + part * dz, yaw


@kernel
def travelled(walk: WalkGraph, edge: int, direction: int, station: float) -> float:
    """A station seen in the direction of walking: metres from where the edge was entered."""
    return station if direction > 0 else walk.length_m[edge] - station


@kernel
def road_part(walk: WalkGraph, edge: int, direction: int) -> tuple[float, float, float]:
    """Kerb and edges of the driving part in the direction of walking: (kerb, begin, end) [m]."""
    begin, end = walk.road_begin_m[edge], walk.road_end_m[edge]
    if direction < 0:
        begin, end = walk.length_m[edge] - end, walk.length_m[edge] - begin
    return max(begin - KERB_M - BODY_M, 0.0), begin, end


@kernel
def guide_of(state: State, walk: WalkGraph, walker: int) -> Place:
    """The place that a walker's body is bound for."""
    return place_on_edge(
        walk, state.walk_edge[walker], state.walk_m[walker], state.walk_direction[walker]
    )


@kernel
def is_over(state: State, walk: WalkGraph, walker: int) -> bool:
    """Whether a walker's body is beyond the driving part of his crosswalk, in his direction."""
    edge, direction = state.walk_edge[walker], state.walk_direction[walker]
    guide = guide_of(state, walk, walker)
    _kerb, _begin, end = road_part(walk, edge, direction)
    behind = (guide[0] - state.x[walker]) * math.cos(guide[3])
    behind += (guide[1] - state.y[walker]) * math.sin(guide[3])
    return travelled(walk, edge, direction, state.walk_m[walker]) - behind >= end + BODY_M


@kernel
def mark_busy_crosswalks(state: State, walk: WalkGraph, busy: Int8) -> None:
    """Sets busy (X,) int8 to 1 where a walker is on the driving part of a crosswalk, else 0.

    From the step off the kerb to the far edge; walkers who wait do not count, who lie there do.
    """
    busy[:] = 0
    for walker in range(state.kind.size):
        edge = state.walk_edge[walker]
        if state.kind[walker] != WALKER or edge < 0:  # one of a scenario has no edge
            continue
        if walk.crosswalk[edge] < 0:
            continue
        direction = state.walk_direction[walker]
        kerb, _begin, _end = road_part(walk, edge, direction)
        led = travelled(walk, edge, direction, state.walk_m[walker]) > kerb
        if led and not is_over(state, walk, walker):
            busy[walk.crosswalk[edge]] = 1
