"""Where walkers stand at first: on sidewalks, by keyed draws, each with a pace of their own."""

from __future__ import annotations

from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.world.state import ActorKind, State
from di_envs.world.walkers.crossing import BODY_M
from di_envs.world.walkers.on_edges import place_on_edge
from di_envs.world.walkers.walk_graph import WalkGraph

SLOWEST_MPS, FASTEST_MPS = 0.8, 1.8
HEIGHT_M = 1.7
SPAWN_TRIES = 8
SPAWN_ROOM_M = 2.0  # from the middle of an edge, so half of it is left beside it

SPAWN_STREAM, PACE_STREAM = int(Stream.WALKER_SPAWN), int(Stream.WALKER_PACE)
ABSENT, WALKER = int(ActorKind.ABSENT), int(ActorKind.WALKER)


@kernel
def _sidewalk_at(walk: WalkGraph, share: float) -> tuple[int, float]:
    """The edge and station at a share of all sidewalks' length; crosswalks are left out."""
    total = 0.0
    for edge in range(walk.first.size):
        if walk.crosswalk[edge] < 0:
            total += walk.length_m[edge]
    rest, last = share * total, -1
    for edge in range(walk.first.size):
        if walk.crosswalk[edge] < 0:
            last = edge
            if rest < walk.length_m[edge]:
                return edge, rest
            rest -= walk.length_m[edge]
    return last, 0.0


@kernel
def _is_free(
    state: State, walk: WalkGraph, first: int, walker: int, edge: int, station: float
) -> bool:
    """Whether no walker before this one stands near a station [m] of an edge."""
    x, y, _, _ = place_on_edge(walk, edge, station, 1)
    for other in range(first, walker):
        if state.kind[other] == WALKER:
            dx, dy = state.x[other] - x, state.y[other] - y
            if dx * dx + dy * dy < SPAWN_ROOM_M * SPAWN_ROOM_M:
                return False
    return True


@kernel
def spawn_walkers(state: State, walk: WalkGraph, first: int, count: int) -> None:
    """Puts walkers [first, first + count) on sidewalks, all by keyed draws.

    Where there is no sidewalk, or none free after eight draws, the slot stays ABSENT.
    """
    seed = int(state.seed[()])
    for walker in range(first, first + count):
        state.kind[walker] = ABSENT
        for attempt in range(SPAWN_TRIES):
            edge, station = _sidewalk_at(walk, uniform(seed, SPAWN_STREAM, attempt, walker))
            if edge >= 0 and _is_free(state, walk, first, walker, edge, station):
                _stand_up(state, walk, walker, edge, station)
                break


@kernel
def _stand_up(state: State, walk: WalkGraph, walker: int, edge: int, station: float) -> None:
    """Fills the slot of a walker who stands at a station [m] of an edge."""
    seed = int(state.seed[()])
    state.kind[walker] = WALKER
    state.half_length[walker] = BODY_M
    state.half_width[walker] = BODY_M
    state.height[walker] = HEIGHT_M
    state.lane[walker] = -1
    state.walk_edge[walker] = edge
    state.walk_m[walker] = station
    forth = uniform(seed, SPAWN_STREAM, SPAWN_TRIES, walker) < 0.5
    state.walk_direction[walker] = 1 if forth else -1
    state.walk_waiting[walker] = 0
    state.walk_side[walker] = 0
    state.shock_ticks[walker] = 0
    state.still_ticks[walker] = 0
    state.speed[walker] = 0.0
    share = uniform(seed, PACE_STREAM, 0, walker)
    state.desired_factor[walker] = SLOWEST_MPS + share * (FASTEST_MPS - SLOWEST_MPS)
    x, y, z, yaw = place_on_edge(walk, edge, station, state.walk_direction[walker])
    state.x[walker], state.y[walker], state.z[walker] = x, y, z
    state.yaw[walker] = yaw
