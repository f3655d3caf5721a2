"""Junctions: enter only with room behind, and never into the way of those who cross, as kernels."""

from __future__ import annotations

from typing import NamedTuple

from agents.expert.config import ExpertNumbers
from agents.expert.path import DrivePath
from agents.expert.progress import Progress
from agents.expert.rules import PAST_LINE_M
from agents.expert.sight import INSIDE_M, ROOM_M, Sight
from agents.expert.speed import (
    NO_LIMIT_MPS2,
    braking_needed,
    stop_within,
    time_over,
    time_to,
)
from agents.expert.surroundings import Actors, Ways
from di_envs.numerics.arrays import Float64
from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.world.state import PATH_LANES

ZONE_MARGIN_M = 0.8  # kept from a crossing place
SOON_MPS2, LATE_MPS2 = 3.0, 1.0  # others gain speed at most, and at least, this fast
COMMITTED_MPS2 = 7.0  # who would have to brake harder than this goes on


class JunctionAhead(NamedTuple):
    """The next junction on the path, or the one that the car is on."""

    junction: int  # -1 for none
    first_leg: int
    end_leg: int  # behind the last
    begin_m: float  # stations of the path
    end_m: float


@kernel
def junction_ahead(path: DrivePath, progress: Progress, half_length: float) -> JunctionAhead:
    """The junction that the car's tail has not left yet."""
    tail = progress.station_m - half_length
    for first in range(path.leg_lane.size):
        if path.leg_junction[first] < 0 or path.leg_end_m[first] < tail:
            continue
        junction, last = path.leg_junction[first], first
        while last < path.leg_lane.size and path.leg_junction[last] == junction:
            last += 1
        begin_m, end_m = path.leg_begin_m[first], path.leg_end_m[last - 1]
        return JunctionAhead(as_int64(junction), first, last, begin_m, end_m)
    return JunctionAhead(as_int64(-1), 0, 0, 1e9, 1e9)


@kernel
def station_on(actors: Actors, ways: Ways, actor: int, way: int) -> float:
    """Station of a vehicle's centre on a junction lane of its path; negative before it.

    Very large if the vehicle has left it behind or does not go there.
    """
    lane, s = actors.lane[actor], actors.lane_m[actor]
    if lane == way:
        return s
    if actors.previous_lane[actor] == way:
        return ways.length_m[way] + s
    distance = ways.length_m[lane] - s
    for step in range(1, PATH_LANES):
        ahead = actors.path[actor, step]
        if ahead < 0:
            break
        if ahead == way:
            return -distance
        distance += ways.length_m[ahead]
    return 1e6


@kernel
def _share_start(ways: Ways, a: int, b: int) -> bool:
    """Whether two junction lanes begin at the same lane."""
    for i in range(ways.predecessor_start[a], ways.predecessor_start[a + 1]):
        for j in range(ways.predecessor_start[b], ways.predecessor_start[b + 1]):
            if ways.predecessor[i] == ways.predecessor[j]:
                return True
    return False


@kernel
def _meets(
    actors: Actors,
    ways: Ways,
    actor: int,
    conflict: int,
    begin_m: float,
    end_m: float,
    progress: Progress,
    half: float,
    times: Float64,
    numbers: ExpertNumbers,
) -> bool:
    """Whether a vehicle and the car would be in a crossing place at the same time.

    Args:
        conflict: Index into the lanes' conflicts.
        begin_m, end_m: Stations of the crossing place on the car's path.
    """
    way = ways.conflict_lane[conflict]
    length, speed = actors.half_length[actor], actors.speed[actor]
    s = station_on(actors, ways, actor, way)
    to_leave = ways.conflict_other_end_m[conflict] + length - s
    if to_leave <= 0.0:
        return False
    to_enter = ways.conflict_other_begin_m[conflict] - length - s
    enters = time_over(to_enter, speed, SOON_MPS2)
    leaves = time_over(to_leave, speed, LATE_MPS2)
    arrives = time_to(times, begin_m - half - progress.station_m)
    gone = time_to(times, end_m + half - progress.station_m)
    return leaves + numbers.clear_before_s > arrives and gone + numbers.clear_after_s > enters


@kernel
def crossing_acceleration(
    sight: Sight,
    path: DrivePath,
    progress: Progress,
    actors: Actors,
    ways: Ways,
    ego: int,
    ahead: JunctionAhead,
    times: Float64,
    numbers: ExpertNumbers,
) -> float:
    """What those who hold a grant for a crossing way allow.

    Args:
        sight: From `look`.
        path: The route's path.
        progress: Where the car is on it.
        actors: Everybody.
        ways: The town's lanes.
        ego: The car.
        ahead: The junction.
        times: From `forecast`.
        numbers: From `ExpertConfig`.

    Returns:
        Acceleration [m/s2].
    """
    best = NO_LIMIT_MPS2
    half = actors.half_length[ego]
    for leg in range(ahead.first_leg, ahead.end_leg):
        lane, offset_m = path.leg_lane[leg], path.leg_offset_m[leg]
        for k in range(ways.conflict_start[lane], ways.conflict_start[lane + 1]):
            begin_m, end_m = ways.conflict_begin_m[k] + offset_m, ways.conflict_end_m[k] + offset_m
            behind = end_m < progress.station_m - half
            if behind or progress.station_m + half > begin_m + ZONE_MARGIN_M:
                continue  # left behind, or already in it: then the others wait
            if _share_start(ways, lane, ways.conflict_lane[k]):
                continue  # they part from the car's own lane: leaders or followers
            for i in range(sight.holders[0]):
                actor = sight.holder[i]
                if _meets(actors, ways, actor, k, begin_m, end_m, progress, half, times, numbers):
                    front_m, speed = progress.station_m + half, actors.speed[ego]
                    wait = _wait_before(begin_m, ahead.begin_m, front_m, speed, numbers)
                    best = min(best, wait)
    return best


@kernel
def _wait_before(
    place_m: float, junction_m: float, front_m: float, speed: float, numbers: ExpertNumbers
) -> float:
    """Stops before a crossing place, or better before the junction, if there is still time.

    Args:
        place_m: Station where the place begins.
        junction_m: Station where the junction begins.
        front_m: Station of the car's front.
        speed: The car's [m/s].
        numbers: From `ExpertConfig`.

    Returns:
        Acceleration [m/s2].
    """
    stop_m, line_m = place_m - ZONE_MARGIN_M, junction_m - numbers.line_margin_m
    if front_m < junction_m + PAST_LINE_M and _can_still_wait(line_m - front_m, speed):
        stop_m = min(stop_m, line_m)
    if _can_still_wait(stop_m - front_m, speed):
        return stop_within(stop_m - front_m, speed, numbers)
    return NO_LIMIT_MPS2


@kernel
def _can_still_wait(distance_m: float, speed: float) -> bool:
    """Whether the car is not yet committed to going on past a place."""
    return braking_needed(distance_m, speed) < COMMITTED_MPS2 or speed < 0.5


@kernel
def exit_acceleration(
    sight: Sight,
    begin_m: float,
    front_m: float,
    half_length: float,
    speed: float,
    numbers: ExpertNumbers,
) -> float:
    """Waits before a junction whose exit has no room for the car."""
    if front_m > begin_m + PAST_LINE_M:
        return NO_LIMIT_MPS2
    need = 2.0 * half_length + numbers.exit_gap_m + sight.number[INSIDE_M]
    if sight.number[ROOM_M] >= need:
        return NO_LIMIT_MPS2
    distance = begin_m - numbers.line_margin_m - front_m
    if braking_needed(distance, speed) > COMMITTED_MPS2 and speed > 0.5:
        return NO_LIMIT_MPS2
    return stop_within(distance, speed, numbers)
