"""Walkers stroll along sidewalks at their own pace, and cross where it is safe.

Each follows the edges of the walking graph, to the right of their lines, and takes a keyed choice
of where to go at each end. Who was knocked down by an ego lies for ten seconds and is taken away.
"""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Int8
from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.town.lanes import Signals
from di_envs.world.contact import DOWN
from di_envs.world.state import TICK_S, ActorKind, State
from di_envs.world.walkers.crossing import BODY_M, is_blocked, may_cross
from di_envs.world.walkers.personal_space import step_is_free
from di_envs.world.walkers.walk_graph import WalkGraph

SLOWEST_MPS, FASTEST_MPS = 0.8, 1.8
CROSSING_MPS = 1.3  # nobody dawdles on a crosswalk
KERB_M = 1.0  # from the driving lane at which walkers wait: long vehicles swing out that far
BESIDE_M = 0.8  # kept behind somebody who walks ahead …
FOLLOW_M = 1.2  # … and within which one takes on their speed
MARGIN_M = 0.3  # kept from vehicles
SQUEEZE_TICKS = round(10.0 / TICK_S)  # of standing still after which that margin is given up
GIVE_UP_TICKS = round(40.0 / TICK_S)  # of waiting at a kerb after which one turns back
LOOK_TICKS = round(0.2 / TICK_S)  # between two looks of somebody who waits at a kerb
PATIENCE_TICKS = round(2.0 / TICK_S)  # with others in the way; some have up to twice as much
LIE_TICKS = round(10.0 / TICK_S)
HEIGHT_M = 1.7
SPAWN_TRIES = 8
SPAWN_ROOM_M = 2.0  # from the middle of an edge, so half of it is left beside it

SPAWN_STREAM, PACE_STREAM = int(Stream.WALKER_SPAWN), int(Stream.WALKER_PACE)
TURN_STREAM = int(Stream.WALKER_TURN)
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
def place_on_edge(
    walk: WalkGraph, edge: int, station: float, direction: int
) -> tuple[float, float, float, float]:
    """Where somebody walks who goes in `direction` at a station: (x, y, z, yaw)."""
    step = station / walk.spacing_m[edge]
    k = min(max(int(step), 0), walk.size[edge] - 2)
    part = step - k
    a, b = walk.points[walk.first[edge] + k], walk.points[walk.first[edge] + k + 1]
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    side = direction * walk.side_m[edge] / max(math.sqrt(dx * dx + dy * dy), 1e-9)
    yaw = a[3]  # in [-pi, pi]
    if direction < 0:
        yaw += math.pi if yaw < 0.0 else -math.pi
    return a[0] + part * dx - side * dy, a[1] + part * dy + side * dx, a[2] + part * dz, yaw


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
    state.still_ticks[walker] = 0
    state.speed[walker] = 0.0
    share = uniform(seed, PACE_STREAM, 0, walker)
    state.desired_factor[walker] = SLOWEST_MPS + share * (FASTEST_MPS - SLOWEST_MPS)
    x, y, z, yaw = place_on_edge(walk, edge, station, state.walk_direction[walker])
    state.x[walker], state.y[walker], state.z[walker] = x, y, z
    state.yaw[walker] = yaw


@kernel
def _travelled(walk: WalkGraph, edge: int, direction: int, station: float) -> float:
    """A station seen in the direction of walking: metres from where the edge was entered."""
    return station if direction > 0 else walk.length_m[edge] - station


@kernel
def _road_part(walk: WalkGraph, edge: int, direction: int) -> tuple[float, float, float]:
    """Kerb and edges of the driving part in the direction of walking: (kerb, begin, end) [m]."""
    begin, end = walk.road_begin_m[edge], walk.road_end_m[edge]
    if direction < 0:
        begin, end = walk.length_m[edge] - end, walk.length_m[edge] - begin
    return max(begin - KERB_M - BODY_M, 0.0), begin, end


@kernel
def _behind_others(state: State, walker: int, first: int, end: int, pace: float) -> float:
    """The pace, slowed to that of somebody close ahead on the same edge, going the same way."""
    edge, direction = state.walk_edge[walker], state.walk_direction[walker]
    at, edges = state.walk_m[walker], state.walk_edge
    for other in range(first, end):
        if edges[other] != edge or other == walker or state.kind[other] != WALKER:
            continue
        if state.walk_direction[other] != direction:
            continue
        gap = (state.walk_m[other] - at) * direction
        if 0.0 < gap < FOLLOW_M or (gap == 0.0 and other > walker):
            pace = 0.0 if gap < BESIDE_M else min(pace, state.speed[other])
    return pace


@kernel
def _must_wait(
    state: State, walk: WalkGraph, signals: Signals, walker: int, first: int, pace: float
) -> bool:
    """Whether the walker has come to the kerb and may not cross yet."""
    edge, direction = state.walk_edge[walker], state.walk_direction[walker]
    kerb, _begin, end = _road_part(walk, edge, direction)
    at = _travelled(walk, edge, direction, state.walk_m[walker])
    if at > kerb or at + pace * TICK_S < kerb:
        return False
    if (state.tick[()] + walker) % LOOK_TICKS != 0:  # they do not look all the time
        return True
    needed_ticks = int((end - kerb) / pace / TICK_S) + 1
    return not may_cross(state, walk, signals, walk.crosswalk[edge], needed_ticks, first)


@kernel
def _turn_back(state: State, walker: int) -> None:
    """Lets a walker go the other way, with new patience."""
    state.walk_direction[walker] = -state.walk_direction[walker]
    state.walk_waiting[walker] = 0
    state.still_ticks[walker] = 0


@kernel
def _go_on(state: State, walk: WalkGraph, walker: int) -> None:
    """At an edge's end: a keyed choice of the next, or back where there is none."""
    edge, direction = state.walk_edge[walker], state.walk_direction[walker]
    end = 2 * edge + (1 if direction > 0 else 0)
    begin = walk.next_start[end]
    choices = walk.next_start[end + 1] - begin
    if choices == 0:
        state.walk_m[walker] = walk.length_m[edge] if direction > 0 else 0.0
        _turn_back(state, walker)
        return
    draw = uniform(int(state.seed[()]), TURN_STREAM, int(state.tick[()]), walker)
    link = begin + int(draw * choices)
    state.walk_edge[walker] = walk.next_edge[link]
    state.walk_direction[walker] = walk.next_direction[link]
    from_start = walk.next_direction[link] > 0
    state.walk_m[walker] = 0.0 if from_start else walk.length_m[walk.next_edge[link]]


@kernel
def _step_towards(
    state: State, walk: WalkGraph, walker: int, reach_m: float, first: int, end: int
) -> bool:
    """Moves the body towards its place, at most `reach_m`: corners are cut, not leapt.

    Returns:
        Whether it could; not where another walker is in the way.
    """
    x, y, z, yaw = place_on_edge(
        walk, state.walk_edge[walker], state.walk_m[walker], state.walk_direction[walker]
    )
    dx, dy = x - state.x[walker], y - state.y[walker]
    distance = math.sqrt(dx * dx + dy * dy)
    share = 1.0 if distance <= reach_m else reach_m / distance
    x, y = state.x[walker] + share * dx, state.y[walker] + share * dy
    if not step_is_free(state, walker, first, end, x, y):
        return False
    state.x[walker], state.y[walker] = x, y
    state.z[walker] = z
    state.yaw[walker] = yaw
    speed = share * distance / TICK_S
    state.acceleration[walker] = (speed - state.speed[walker]) / TICK_S
    state.speed[walker] = speed
    return True


@kernel
def _lie(state: State, walker: int) -> None:
    """One tick of a walker who was knocked down; after a while he is taken away."""
    state.speed[walker] = 0.0
    state.still_ticks[walker] += 1
    if state.still_ticks[walker] > LIE_TICKS:
        state.kind[walker] = ABSENT


@kernel
def _stand(state: State, walker: int, waiting: int) -> None:
    """One tick of a walker who stands; `waiting` is 1 at a kerb, where he gives up some time."""
    state.speed[walker] = 0.0
    state.acceleration[walker] = 0.0
    state.walk_waiting[walker] = waiting
    state.still_ticks[walker] += 1
    if waiting == 1 and state.still_ticks[walker] > GIVE_UP_TICKS:
        _turn_back(state, walker)


@kernel
def _is_held(state: State, walker: int, pace: float, bodies: int) -> bool:
    """Whether a vehicle among the first `bodies` actors is in the way of the next step."""
    margin = MARGIN_M if state.still_ticks[walker] < SQUEEZE_TICKS else 0.0
    return is_blocked(
        state,
        bodies,
        state.x[walker],
        state.y[walker],
        state.z[walker],
        state.yaw[walker],
        pace * TICK_S + 0.1,
        margin,
    )


@kernel
def _walk_on(
    state: State, walk: WalkGraph, signals: Signals, walker: int, first: int, end: int
) -> None:
    """One tick of a walker on his feet; arguments as of `move_walkers`."""
    edge, direction = state.walk_edge[walker], state.walk_direction[walker]
    crossing = walk.crosswalk[edge] >= 0
    pace = state.desired_factor[walker]
    if crossing:
        pace = max(pace, CROSSING_MPS)
        if _must_wait(state, walk, signals, walker, first, pace):
            _stand(state, walker, 1)
            return
    pace = _behind_others(state, walker, first, end, pace)
    # on sidewalks only egos can be in the way
    bodies = first if crossing else state.throttle.size
    if pace <= 0.0 or _is_held(state, walker, pace, bodies):
        _stand(state, walker, 0)
        return
    station = state.walk_m[walker]
    state.walk_m[walker] += direction * pace * TICK_S
    if not 0.0 <= state.walk_m[walker] <= walk.length_m[edge]:
        _go_on(state, walk, walker)
    if _step_towards(state, walk, walker, 2.0 * pace * TICK_S, first, end):
        state.walk_waiting[walker] = 0
        state.still_ticks[walker] = 0
        return
    state.walk_edge[walker], state.walk_m[walker] = edge, station
    state.walk_direction[walker] = direction
    _stand(state, walker, 0)
    share = uniform(int(state.seed[()]), PACE_STREAM, 1, walker)
    if state.still_ticks[walker] > (1.0 + share) * PATIENCE_TICKS:
        _turn_back(state, walker)


@kernel
def move_walkers(state: State, walk: WalkGraph, signals: Signals, first: int, end: int) -> None:
    """Advances the walkers, the actors [first, end), by a tick; lights and vehicles are read as is.

    Actors before `first` are the egos and vehicles that walkers look out for.
    """
    for walker in range(first, end):
        if state.kind[walker] != WALKER:
            continue
        if state.walk_waiting[walker] == DOWN:
            _lie(state, walker)
        else:
            _walk_on(state, walk, signals, walker, first, end)


@kernel
def mark_busy_crosswalks(state: State, walk: WalkGraph, busy: Int8) -> None:
    """Sets busy (X,) int8 to 1 where a walker is on the driving part of a crosswalk, else 0.

    From the step off the kerb to the far edge; walkers who wait do not count, who lie there do.
    """
    busy[:] = 0
    kind, walk_edge, walk_m = state.kind, state.walk_edge, state.walk_m
    for walker in range(kind.size):
        if kind[walker] != WALKER or walk_edge[walker] < 0:  # one of a scenario has no edge
            continue
        if walk.crosswalk[walk_edge[walker]] < 0:
            continue
        edge, direction = walk_edge[walker], state.walk_direction[walker]
        kerb, _begin, end = _road_part(walk, edge, direction)
        if kerb < _travelled(walk, edge, direction, walk_m[walker]) < end + BODY_M:
            busy[walk.crosswalk[edge]] = 1
