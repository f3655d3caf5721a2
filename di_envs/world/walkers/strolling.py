"""Walkers stroll along sidewalks at their own pace, and cross where it is safe.

Each follows the edges of the walking graph, to the right of their lines, and takes a keyed choice
of where to go at each end. A guide, the station `walk_m`, goes ahead on the line and the body comes
after, round whoever is in its way. Who was knocked down by an ego lies a while and is taken away.
"""

from __future__ import annotations

import math

from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.town.lanes import Signals
from di_envs.world.state import TICK_S, ActorKind, State
from di_envs.world.struck import DOWN, lie, take_away
from di_envs.world.walkers.crossing import is_blocked, may_cross
from di_envs.world.walkers.neighbours import Neighbours, cell_of, cells_around, fill_neighbours
from di_envs.world.walkers.on_edges import (
    Place,
    guide_of,
    is_over,
    place_on_edge,
    road_part,
    travelled,
)
from di_envs.world.walkers.personal_space import step_aside, step_is_free
from di_envs.world.walkers.walk_graph import WalkGraph

CROSSING_MPS = 1.3  # nobody dawdles on a crosswalk
BESIDE_M = 0.8  # kept behind somebody who walks ahead …
FOLLOW_M = 1.2  # … and within which one takes on their speed
MARGIN_M = 0.3  # kept from vehicles
SQUEEZE_TICKS = round(10.0 / TICK_S)  # of standing still after which that margin is given up
GIVE_UP_TICKS = round(40.0 / TICK_S)  # of waiting at a kerb after which one turns back
LOOK_TICKS = round(0.2 / TICK_S)  # between two looks of somebody who waits at a kerb
PATIENCE_TICKS = round(4.0 / TICK_S)  # with others in the way; some have up to twice as much
LEASH_M = 1.2  # from the body, up to which its guide goes ahead: round somebody who stands

PACE_STREAM, TURN_STREAM = int(Stream.WALKER_PACE), int(Stream.WALKER_TURN)
WALKER = int(ActorKind.WALKER)


@kernel
def _behind_others(state: State, near: Neighbours, walker: int, pace: float) -> tuple[float, bool]:
    """The pace behind somebody close ahead on the same edge, going the same way.

    Returns:
        (pace [m/s], whether it is 0 because those ahead wait at a kerb). Whoever stands for another
        reason is gone round.
    """
    edge, direction = state.walk_edge[walker], state.walk_direction[walker]
    at, edges = state.walk_m[walker], state.walk_edge
    queues = False
    left, right, top, bottom = cells_around(state.x[walker], state.y[walker])
    for row in range(top, bottom):
        for column in range(left, right):
            other = near.first[cell_of(column, row)]
            while other >= 0:
                same = edges[other] == edge and state.walk_direction[other] == direction
                if same and other != walker:
                    gap = (state.walk_m[other] - at) * direction
                    if 0.0 < gap < FOLLOW_M or (gap == 0.0 and other > walker):
                        queue = state.walk_waiting[other] == 1
                        moves = state.speed[other] > 0.0
                        if gap < BESIDE_M and (queue or moves):
                            pace = 0.0
                        elif moves:
                            pace = min(pace, state.speed[other])
                        queues = queues or (queue and gap < BESIDE_M)
                other = near.next[other]
    return pace, queues


@kernel
def _must_wait(
    state: State, walk: WalkGraph, signals: Signals, near: Neighbours, walker: int, pace: float
) -> bool:
    """Whether the walker has come to the kerb and may not cross yet."""
    edge, direction = state.walk_edge[walker], state.walk_direction[walker]
    kerb, _begin, end = road_part(walk, edge, direction)
    at = travelled(walk, edge, direction, state.walk_m[walker])
    if at > kerb or at + pace * TICK_S < kerb:
        return False
    if (state.tick[()] + walker) % LOOK_TICKS != 0:  # they do not look all the time
        return True
    needed_ticks = int((end - kerb) / pace / TICK_S) + 1
    return not may_cross(state, walk, signals, near, walk.crosswalk[edge], needed_ticks)


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
def _lead_on(state: State, walk: WalkGraph, walker: int, pace: float) -> tuple[bool, Place]:
    """Moves a walker's guide on by a tick, if the body is near enough.

    It leaves a crosswalk only when the body is off the road.

    Returns:
        (whether it could, the guide's place then).
    """
    edge, direction = state.walk_edge[walker], state.walk_direction[walker]
    station = state.walk_m[walker]
    ahead = station + direction * pace * TICK_S
    if not 0.0 <= ahead <= walk.length_m[edge]:
        if walk.crosswalk[edge] < 0 or is_over(state, walk, walker):
            _go_on(state, walk, walker)
            return True, guide_of(state, walk, walker)
        ahead = min(max(ahead, 0.0), walk.length_m[edge])
    guide = place_on_edge(walk, edge, ahead, direction)
    dx, dy = guide[0] - state.x[walker], guide[1] - state.y[walker]
    if ahead == station or dx * dx + dy * dy > LEASH_M * LEASH_M:
        return False, guide_of(state, walk, walker)
    state.walk_m[walker] = ahead
    return True, guide


@kernel
def _follow_guide(
    state: State,
    walk: WalkGraph,
    near: Neighbours,
    walker: int,
    pace: float,
    guide: Place,
    on_road: bool,
) -> bool:
    """Moves the body towards its guide: corners are cut, not leapt, and others gone round.

    Returns:
        Whether it could; not where others leave no room.
    """
    before_x, before_y = state.x[walker], state.y[walker]
    dx, dy = guide[0] - before_x, guide[1] - before_y
    distance = math.sqrt(dx * dx + dy * dy)
    reach = 2.0 * pace * TICK_S  # to make up for a cut or a way round
    share = 1.0 if distance <= reach else reach / distance
    x, y = before_x + share * dx, before_y + share * dy
    if step_is_free(state, near, walker, x, y):
        state.x[walker], state.y[walker] = x, y
        state.walk_side[walker] = 0
    elif not step_aside(state, walk, near, walker, pace * TICK_S, guide, on_road):
        return False
    dx, dy = state.x[walker] - before_x, state.y[walker] - before_y
    speed = math.sqrt(dx * dx + dy * dy) / TICK_S
    state.z[walker] = guide[2]
    state.yaw[walker] = guide[3]
    state.acceleration[walker] = (speed - state.speed[walker]) / TICK_S
    state.speed[walker] = speed
    return True


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
def _is_held(state: State, near: Neighbours, walker: int, pace: float, on_road: bool) -> bool:
    """Whether a vehicle is in the way of the next step."""
    margin = MARGIN_M if state.still_ticks[walker] < SQUEEZE_TICKS else 0.0
    return is_blocked(
        state,
        near,
        on_road,
        state.x[walker],
        state.y[walker],
        state.z[walker],
        state.yaw[walker],
        pace * TICK_S + 0.1,
        margin,
    )


@kernel
def _walk_on(
    state: State, walk: WalkGraph, signals: Signals, near: Neighbours, walker: int
) -> None:
    """One tick of a walker on his feet; arguments as of `move_walkers`."""
    crossing = walk.crosswalk[state.walk_edge[walker]] >= 0
    pace = state.desired_factor[walker]
    if crossing:
        pace = max(pace, CROSSING_MPS)
        if _must_wait(state, walk, signals, near, walker, pace):
            _stand(state, walker, 1)
            return
    pace, queues = _behind_others(state, near, walker, pace)
    if pace <= 0.0 or _is_held(state, near, walker, pace, crossing):
        _stand(state, walker, 1 if queues else 0)
        return
    still = state.still_ticks[walker]
    led, guide = _lead_on(state, walk, walker, pace)
    if _follow_guide(state, walk, near, walker, pace, guide, crossing):
        state.walk_waiting[walker] = 0
    else:
        _stand(state, walker, 0)
    state.still_ticks[walker] = 0 if led else still + 1
    if _has_lost_patience(state, walker):
        _turn_back(state, walker)


@kernel
def _has_lost_patience(state: State, walker: int) -> bool:
    """Whether others have been in a walker's way for longer than he bears."""
    still = state.still_ticks[walker]
    if still <= PATIENCE_TICKS:  # nobody has less: no need to draw
        return False
    share = uniform(int(state.seed[()]), PACE_STREAM, 1, walker)
    return still > (1.0 + share) * PATIENCE_TICKS


@kernel
def move_walkers(
    state: State, walk: WalkGraph, signals: Signals, near: Neighbours, first: int, end: int
) -> None:
    """Advances the walkers, the actors [first, end), by a tick; lights and vehicles are read as is.

    Actors before `first` are the egos and vehicles that walkers look out for; `near` is scratch.
    """
    fill_neighbours(near, state, first, end)
    for walker in range(first, end):
        if state.kind[walker] != WALKER:
            continue
        if state.walk_waiting[walker] == DOWN:
            if lie(state, walker):
                take_away(state, walker)
        else:
            _walk_on(state, walk, signals, near, walker)
