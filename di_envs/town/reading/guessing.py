"""Signals guessed from the shape of junctions, for maps that carry none.

Lights stand where roads cross and at least three arms are main ones: of two lanes or more, or
faster than a residential street. They stand too where two roads of several lanes join at an angle,
but for roundabouts. Where side streets cross or join a main road they stop; where no
arm is a main one, all stop (at a T: its stem). A ramp that merges at an acute angle, and every
other junction where nothing crosses and nobody joins at an angle, has nothing.
"""

from __future__ import annotations

import numpy as np

from di_envs.town.lanes import LaneKind, Lanes, SignalKind
from di_envs.town.reading.arms import Arm, junction_arms, stem_of
from di_envs.town.reading.signals import Head, heads_of_arms

RESIDENTIAL_MPS = 32.5 / 3.6  # 30 km/h, 20 mph: a single lane no faster is no main road
MAIN_ARMS = 3  # so many main arms that cross have lights
CROSSING_ARMS = 4  # at so many arms without a main road everybody stops
CROSSING_SINE = 0.3  # lanes that meet flatter than this run side by side
RING_M = 150.0  # a way round a roundabout, shorter than one round a block
MERGE_COSINE = 0.5  # an arm that points so far the way of another merges into it

Exit = tuple[int, bool]  # road, whether its lane ids are positive


def guessed_heads(lanes: Lanes, junctions: tuple[str, ...]) -> list[Head]:
    """The heads that a town would have, as the module says."""
    heads = []
    for junction, arms in enumerate(junction_arms(lanes, len(junctions))):
        heads += heads_of_arms(arms, guessed_kinds(lanes, junction, arms))
    return heads


def guessed_kinds(lanes: Lanes, junction: int, arms: list[Arm]) -> list[SignalKind | None]:
    """What stands at each arm of a junction."""
    main = [_is_main(lanes, arm) for arm in arms]
    crossing = len(arms) >= MAIN_ARMS and roads_cross(lanes, junction, arms)
    if (crossing and sum(main) >= MAIN_ARMS) or (
        _wide_roads_join(lanes, junction, arms) and not _is_on_a_ring(lanes, junction)
    ):
        return [SignalKind.LIGHT] * len(arms)
    stem = stem_of(arms)
    if crossing and any(main):
        stopping = [not own for own in main]
        if not any(stopping):
            stopping = [arm in stem for arm in arms]
    elif len(arms) >= CROSSING_ARMS and crossing:
        stopping = [True] * len(arms)
    else:
        stopping = [arm in stem and not _merges(arm, arms) for arm in arms]
    return [SignalKind.STOP if stops else None for stops in stopping]


def roads_cross(lanes: Lanes, junction: int, arms: list[Arm]) -> bool:
    """Whether two ways through a junction cross that come from and lead to different roads."""
    inside = np.flatnonzero((lanes.junction == junction) & (lanes.kind == LaneKind.DRIVING))
    origins: dict[int, set[int]] = {int(lane): set() for lane in inside}
    exits: dict[int, set[Exit]] = {}
    for number, arm in enumerate(arms):
        for lane in _ways(lanes, junction, list(arm.lanes)):
            origins[lane].add(number)
    for lane in origins:
        ways = (lane, *_ways(lanes, junction, [lane]))
        exits[lane] = {road for way in ways for road in _roads_after(lanes, way)}
    return any(
        not origins[lane] & origins[other]
        and not exits[lane] & exits[other]
        and _at_an_angle(lanes, lane, row)
        for lane in origins
        if origins[lane]
        for row in range(lanes.conflict_start[lane], lanes.conflict_start[lane + 1])
        for other in (int(lanes.conflict_lane[row]),)
        if origins.get(other)
    )


def _wide_roads_join(lanes: Lanes, junction: int, arms: list[Arm]) -> bool:
    """Whether two arms of several lanes lead to one road, at an angle that no ramp has."""
    wide = [arm for arm in arms if len(arm.lanes) > 1]
    exits = [
        {
            road
            for lane in _ways(lanes, junction, list(arm.lanes))
            for road in _roads_after(lanes, lane)
        }
        for arm in wide
    ]
    return any(
        abs(np.cos(a.end[3] - b.end[3])) < MERGE_COSINE and exits[i] & exits[j]
        for i, a in enumerate(wide)
        for j, b in enumerate(wide[:i])
    )


def _is_on_a_ring(lanes: Lanes, junction: int) -> bool:
    """Whether one comes back to a junction within a roundabout's length."""
    inside = np.flatnonzero((lanes.junction == junction) & (lanes.kind == LaneKind.DRIVING))
    reached = {int(lane): 0.0 for lane in inside}
    front = list(reached)
    while front:
        lane = front.pop()
        for after in _successors(lanes, lane):
            way = reached[lane] + float(lanes.length_m[lane])
            if lanes.junction[after] == junction:
                if reached[lane] > 0.0 and way < RING_M:
                    return True
            elif way < min(RING_M, reached.get(after, np.inf)):
                reached[after] = way
                front.append(after)
    return False


def _roads_after(lanes: Lanes, lane: int) -> set[Exit]:
    """The roads outside a junction that follow on a lane in it."""
    return {
        (int(lanes.road[after]), bool(lanes.lane_id[after] > 0))
        for after in _successors(lanes, lane)
        if lanes.junction[after] != lanes.junction[lane]
    }


def _is_main(lanes: Lanes, arm: Arm) -> bool:
    fastest = float(lanes.speed_limit_mps[list(arm.lanes)].max())
    return len(arm.lanes) > 1 or fastest > RESIDENTIAL_MPS


def _merges(arm: Arm, arms: list[Arm]) -> bool:
    """Whether an arm points the way that another does: a ramp."""
    return any(
        np.cos(arm.end[3] - other.end[3]) >= MERGE_COSINE for other in arms if other is not arm
    )


def _successors(lanes: Lanes, lane: int) -> list[int]:
    start = lanes.successor_start
    return [int(after) for after in lanes.successor[start[lane] : start[lane + 1]]]


def _ways(lanes: Lanes, junction: int, front: list[int]) -> list[int]:
    """The lanes of a junction that follow on some lanes, over any number of links."""
    found: dict[int, None] = {}
    front = list(front)
    while front:
        for after in _successors(lanes, front.pop()):
            if lanes.junction[after] == junction and after not in found:
                found[after] = None
                front.append(after)
    return list(found)


def _at_an_angle(lanes: Lanes, lane: int, row: int) -> bool:
    """Whether a lane meets the other one of a row of conflicts at an angle, in its middle."""
    own = 0.5 * (lanes.conflict_begin_m[row] + lanes.conflict_end_m[row])
    others = 0.5 * (lanes.conflict_other_begin_m[row] + lanes.conflict_other_end_m[row])
    turn = _yaw(lanes, lane, own) - _yaw(lanes, int(lanes.conflict_lane[row]), others)
    return bool(abs(np.sin(turn)) > CROSSING_SINE)


def _yaw(lanes: Lanes, lane: int, station: float) -> float:
    step = min(round(station / lanes.spacing_m[lane]), int(lanes.count[lane]) - 1)
    return float(lanes.points[lanes.first[lane] + step, 3])
