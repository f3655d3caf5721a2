"""Junctions: enter only with room behind, and never into the way of those who cross, as kernels."""

from __future__ import annotations

from agents.expert.rules import PAST_LINE_M
from agents.expert.sight import INSIDE_M, ROOM_M
from agents.expert.speed import (
    NO_LIMIT_MPS2,
    braking_needed,
    stop_within,
    time_over,
    time_to,
)
from di_envs.numerics.kernels import kernel
from di_envs.world.state import PATH_LANES

ZONE_MARGIN_M = 0.8  # kept from a crossing place
SOON_MPS2, LATE_MPS2 = 3.0, 1.0  # others gain speed at most, and at least, this fast
COMMITTED_MPS2 = 7.0  # who would have to brake harder than this goes on


@kernel
def junction_ahead(path, progress, half_length):
    """The junction that the car's tail has not left yet.

    Returns:
        (junction index or -1, first leg, leg behind the last, begin station, end station).
    """
    tail = progress.station_m - half_length
    for first in range(path.leg_lane.size):
        if path.leg_junction[first] < 0 or path.leg_end_m[first] < tail:
            continue
        junction, last = path.leg_junction[first], first
        while last < path.leg_lane.size and path.leg_junction[last] == junction:
            last += 1
        return junction, first, last, path.leg_begin_m[first], path.leg_end_m[last - 1]
    return -1, 0, 0, 1e9, 1e9


@kernel
def station_on(actors, ways, actor, way):
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
def _share_start(ways, a, b):
    for i in range(ways.predecessor_start[a], ways.predecessor_start[a + 1]):
        for j in range(ways.predecessor_start[b], ways.predecessor_start[b + 1]):
            if ways.predecessor[i] == ways.predecessor[j]:
                return True
    return False


@kernel
def _meets(actors, ways, actor, conflict, begin_m, end_m, progress, half, times, numbers):
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
    sight, path, progress, actors, ways, ego, first, last, begin_m, times, numbers
):
    """What those who hold a grant for a crossing way allow."""
    best = NO_LIMIT_MPS2
    half, speed = actors.half_length[ego], actors.speed[ego]
    front = progress.station_m + half
    for leg in range(first, last):
        lane = path.leg_lane[leg]
        for k in range(ways.conflict_start[lane], ways.conflict_start[lane + 1]):
            way = ways.conflict_lane[k]
            zone_begin = ways.conflict_begin_m[k] + path.leg_offset_m[leg]
            zone_end = ways.conflict_end_m[k] + path.leg_offset_m[leg]
            if zone_end < progress.station_m - half or front > zone_begin + ZONE_MARGIN_M:
                continue  # left behind, or already in it: then the others wait
            if _share_start(ways, lane, way):
                continue  # they part from the car's own lane: leaders or followers
            for i in range(sight.holders[0]):
                actor = sight.holder[i]
                if not _meets(
                    actors, ways, actor, k, zone_begin, zone_end, progress, half, times, numbers
                ):
                    continue
                stop = zone_begin - ZONE_MARGIN_M
                line = begin_m - numbers.line_margin_m
                if front < begin_m + PAST_LINE_M and (
                    braking_needed(line - front, speed) < COMMITTED_MPS2 or speed < 0.5
                ):
                    stop = min(stop, line)
                if braking_needed(stop - front, speed) < COMMITTED_MPS2 or speed < 0.5:
                    best = min(best, stop_within(stop - front, speed, numbers))
    return best


@kernel
def exit_acceleration(sight, begin_m, front_m, half_length, speed, numbers):
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
