"""Junctions: enter only with room behind, and never into the way of those who cross, as kernels."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from agents.expert.config import ExpertNumbers
from agents.expert.crossings import POINT_M, Crossings
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
from agents.expert.visible import CAR, Visible
from di_envs.numerics.arrays import Float64, Int32
from di_envs.numerics.geometry import wrap_angle
from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import LightState, Turn
from di_envs.world.state import ActorKind

ZONE_MARGIN_M = 0.8  # kept from a crossing place
SOON_MPS2, LATE_MPS2 = 3.0, 1.0  # others gain speed at most, and at least, this fast
COMMITTED_MPS2 = 7.0  # who would have to brake harder than this goes on
LOOK_M = 70.0  # before a junction, from which on the car looks who comes
MOST_COMERS = 16  # along one stream
COARSE = 6  # points of a stream that a first look skips
ASIDE_M, ALONG_RAD, LEVEL_M = 1.7, 0.6, 3.0  # within which somebody is on a stream
NOWHERE_M = 1e6
ENTERED_M = 0.3  # with the front this far over the line he goes
INDICATED_M = 12.0  # before a junction, within which everybody shows where he turns
AT_SIGN_M = 2.5  # who moves this near a sign's line, and does not brake, has stood there
STANDS_MPS = 0.3
RED_BRAKING_MPS2 = 5.5  # who would have to brake harder than this runs a light that is not green
YIELDING_MPS2 = 3.0  # who can still brake more gently lets the car go first, if it has the right
PATIENT_S = 2.0  # of standing before a place, after which the car goes before who stands too

_GREEN = int(LightState.GREEN)
_LEFT, _RIGHT = int(Turn.LEFT), int(Turn.RIGHT)
_WALKER = int(ActorKind.WALKER)


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
def station_on(
    crossings: Crossings, stream: int, x: float, y: float, z: float, yaw: float
) -> float:
    """Station of a place on a stream; `NOWHERE_M` off it, or heading elsewhere."""
    first, count = crossings.first[stream], crossings.points[stream]
    nearest, least = 0, math.inf
    for k in range(0, count, COARSE):
        dx, dy = x - crossings.x[first + k], y - crossings.y[first + k]
        square = dx * dx + dy * dy
        if square < least:
            nearest, least = k, square
    if least > (COARSE + ASIDE_M) ** 2:
        return NOWHERE_M
    for k in range(max(nearest - COARSE, 0), min(nearest + COARSE + 1, count)):
        dx, dy = x - crossings.x[first + k], y - crossings.y[first + k]
        square = dx * dx + dy * dy
        if square < least:
            nearest, least = k, square
    point = first + nearest
    turn = wrap_angle(yaw - crossings.yaw[point])
    if least > ASIDE_M * ASIDE_M or abs(turn) > ALONG_RAD or abs(z - crossings.z[point]) > LEVEL_M:
        return NOWHERE_M
    cos, sin = math.cos(crossings.yaw[point]), math.sin(crossings.yaw[point])
    along = cos * (x - crossings.x[point]) + sin * (y - crossings.y[point])
    return nearest * POINT_M - crossings.back_m[stream] + along


@kernel
def will_come(
    crossings: Crossings, stream: int, visible: Visible, row: int, front_m: float, own_rank: int
) -> bool:
    """Whether somebody on a stream looks as if he went through the junction now.

    Args:
        crossings: Of the path.
        stream: That he is on.
        visible: What is in sight.
        row: His.
        front_m: Station of his front on the stream.
        own_rank: The car's.
    """
    if front_m > ENTERED_M:
        return True
    speed = visible.speed[row]
    indicator, turn = visible.indicator[row], crossings.turn[stream]
    wanted = -1 if turn == _LEFT else (1 if turn == _RIGHT else 0)
    if front_m > -INDICATED_M and indicator != wanted:
        return False
    needed = braking_needed(0.5 - front_m, speed)
    light = crossings.light[stream]
    if light >= 0 and visible.light[light] > _GREEN:
        return needed > RED_BRAKING_MPS2
    if speed < STANDS_MPS:
        return False
    braking = visible.brake_light[row] != 0
    if crossings.sign[stream] != 0:
        return not braking and front_m > -AT_SIGN_M
    rank = crossings.rank[stream]
    if rank > own_rank:
        return needed > YIELDING_MPS2 and not braking
    if rank == own_rank and braking:
        return needed > YIELDING_MPS2
    return True


@kernel
def _meets(
    crossings: Crossings,
    meet: int,
    visible: Visible,
    row: int,
    station_m: float,
    progress: Progress,
    times: Float64,
    numbers: ExpertNumbers,
) -> bool:
    """Whether somebody and the car would be in a crossing place at the same time.

    Args:
        crossings: Of the path.
        meet: The place.
        visible: What is in sight.
        row: His.
        station_m: His, on the stream.
        progress: Where the car is on the path.
        times: From `forecast`.
        numbers: From `ExpertConfig`.
    """
    length, speed, half = visible.half_length[row], visible.speed[row], visible.half_length[CAR]
    to_leave = crossings.other_end_m[meet] + length - station_m
    if to_leave <= 0.0:
        return False
    to_enter = crossings.other_begin_m[meet] - length - station_m
    if speed < STANDS_MPS and progress.still_s > PATIENT_S:
        return False  # both stand: the car takes its turn; who is on its path is a leader
    enters = time_over(to_enter, speed, SOON_MPS2)
    leaves = time_over(to_leave, speed, LATE_MPS2)
    arrives = time_to(times, crossings.begin_m[meet] - half - progress.station_m)
    gone = time_to(times, crossings.end_m[meet] + half - progress.station_m)
    return leaves + numbers.clear_before_s > arrives and gone + numbers.clear_after_s > enters


@kernel
def crossing_acceleration(
    crossings: Crossings,
    progress: Progress,
    visible: Visible,
    ahead: JunctionAhead,
    times: Float64,
    numbers: ExpertNumbers,
) -> float:
    """What those who cross the car's way through a junction allow.

    Args:
        crossings: Of the route's path.
        progress: Where the car is on it.
        visible: What is in sight.
        ahead: The junction.
        times: From `forecast`.
        numbers: From `ExpertConfig`.

    Returns:
        Acceleration [m/s2].
    """
    best = NO_LIMIT_MPS2
    half, speed = visible.half_length[CAR], visible.speed[CAR]
    front_m = progress.station_m + half
    if ahead.begin_m - front_m > LOOK_M:
        return best
    begin, end = crossings.meet_start[ahead.first_leg], crossings.meet_start[ahead.first_leg + 1]
    comers, stations = np.empty(MOST_COMERS, np.int32), np.empty(MOST_COMERS)
    stream, count = -1, 0
    for meet in range(begin, end):
        if crossings.stream[meet] != stream:
            stream = crossings.stream[meet]
            rank = crossings.own_rank[ahead.first_leg]
            count = _find_comers(crossings, stream, visible, rank, comers, stations)
        begin_m, end_m = crossings.begin_m[meet], crossings.end_m[meet]
        if end_m < progress.station_m - half or front_m > begin_m + ZONE_MARGIN_M:
            continue  # left behind, or already in it: then the others wait
        for i in range(count):
            if _meets(crossings, meet, visible, comers[i], stations[i], progress, times, numbers):
                best = min(best, _wait_before(begin_m, ahead.begin_m, front_m, speed, numbers))
    return best


@kernel
def _find_comers(
    crossings: Crossings,
    stream: int,
    visible: Visible,
    own_rank: int,
    comers: Int32,
    stations: Float64,
) -> int:
    """Fills in who comes along a stream, and where he is on it; returns how many."""
    first = crossings.first[stream]
    last = first + crossings.points[stream] - 1
    reach, count = crossings.points[stream] * POINT_M + COARSE, 0
    for row in range(CAR + 1, visible.seen[0]):
        if visible.kind[row] >= _WALKER or count == comers.size:
            continue
        x, y = visible.x[row], visible.y[row]
        dx, dy = x - crossings.x[last], y - crossings.y[last]
        if dx * dx + dy * dy > reach * reach:
            continue
        station = station_on(crossings, stream, x, y, visible.z[row], visible.yaw[row])
        if station == NOWHERE_M:
            continue
        front_m = station + visible.half_length[row]
        if will_come(crossings, stream, visible, row, front_m, own_rank):
            comers[count], stations[count] = row, station
            count += 1
    return count


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
