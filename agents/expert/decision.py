"""One decision of the expert, as a kernel: where am I, may I change lanes, how fast, which way."""

from __future__ import annotations

import math

import numpy as np

from agents.expert.actors import look
from agents.expert.config import ExpertNumbers
from agents.expert.control import steering
from agents.expert.crossings import Crossings
from agents.expert.junction import crossing_acceleration, exit_acceleration, junction_ahead
from agents.expert.path import CHANGE_END_M, CHANGE_ROOM_M, DrivePath
from agents.expert.progress import Progress, localise
from agents.expert.rules import line_acceleration, next_line, seconds_yellow, stands_at
from agents.expert.sight import (
    BEST,
    FRONT_OK,
    LEADER_REAR,
    LEADER_SPEED,
    REAR_OK,
    blank_sight,
)
from agents.expert.speed import NO_LIMIT_MPS2, cruise, forecast, stop_within
from agents.expert.visible import CAR, Visible
from di_envs.numerics.kernels import kernel
from di_envs.world.dynamics import EgoParameters, pedals

FORECAST_M = 100
LONGEST_CHANGE_M = 45.0
SHORTEST_CHANGE_M = 8.0
NO_CHANGE_M = -1e6  # where the latest change began, if there was none
QUICKEST_CHANGE_S = 1.7  # to a lane 3.5 m beside; quicker, and the car would be thrown aside
HARDLY_BEGUN = 0.2  # share of a change's length within which the car is still on its lane
BEFORE_CHANGE_S = 3.0  # gaps are looked for from this time before a change may begin
STANDS_MPS, DRIVES_MPS = 0.1, 2.0
MAKE_ROOM_MPS2 = -1.0  # beside somebody whom it has to let pass, the car falls back


@kernel
def start_progress() -> Progress:
    """The memory at a path's start."""
    return Progress(0.0, 0, NO_CHANGE_M, 1.0, 0, 0.0, 0.0, 0.0, 0.0)


@kernel
def update_progress(
    path: DrivePath, progress: Progress, visible: Visible, numbers: ExpertNumbers
) -> Progress:
    """The memory, brought up to where the car is now."""
    speed, half_length = visible.speed[CAR], visible.half_length[CAR]
    station, _, _ = localise(path, progress, visible.x[CAR], visible.y[CAR])
    line = next_line(path, progress.line, station - half_length)
    stood_s = progress.stood_s if line == progress.line else 0.0
    if stands_at(path, line, station + half_length, speed):
        stood_s += numbers.dt_s
    return Progress(
        station,
        progress.changes,
        progress.change_begin_m,
        progress.change_length_m,
        line,
        stood_s,
        progress.waiting_s,
        _seconds_still(progress.still_s, speed, numbers.dt_s),
        seconds_yellow(path, progress.line, line, progress.yellow_s, visible, numbers.dt_s),
    )


@kernel
def _seconds_still(still_s: float, speed: float, dt_s: float) -> float:
    """For how long the car has stood, until it really drives again."""
    if speed < STANDS_MPS:
        return still_s + dt_s
    return still_s if speed < DRIVES_MPS else 0.0


@kernel
def change_due(path: DrivePath, progress: Progress, speed: float) -> float:
    """Offset [m] of the present lane from the one to change to, if that is due soon, else 0."""
    k = progress.changes
    if k >= path.change_jump_m.size:
        return 0.0
    under_way = progress.changes > 0 and (
        progress.station_m < progress.change_begin_m + 0.9 * progress.change_length_m
    )
    if under_way or progress.station_m + BEFORE_CHANGE_S * speed < path.change_jump_m[k]:
        return 0.0
    return path.change_shift_m[k]


@kernel
def taken_back(progress: Progress, speed: float) -> Progress:
    """The memory without a lane change that has hardly begun while the car is slow.

    Somebody may have come meanwhile: whether the gap is free is to be asked again.
    """
    begun_m = progress.station_m - progress.change_begin_m
    if speed > DRIVES_MPS or begun_m > HARDLY_BEGUN * progress.change_length_m:
        return progress
    return Progress(
        progress.station_m,
        progress.changes - 1,
        NO_CHANGE_M,
        progress.change_length_m,
        progress.line,
        progress.stood_s,
        progress.waiting_s,
        progress.still_s,
        progress.yellow_s,
    )


@kernel
def room_for_change(path: DrivePath, progress: Progress) -> float:
    """Metres for the next lane change, if it began here and now; those behind it have as much."""
    k = progress.changes
    limit_m, left = path.change_limit_m[k], 0
    while k < path.change_jump_m.size and path.change_jump_m[k] < limit_m:
        left, k = left + 1, k + 1
    begin_m = max(progress.station_m, path.change_jump_m[progress.changes])
    return max((limit_m - CHANGE_END_M - begin_m) / left, SHORTEST_CHANGE_M)


@kernel
def begin_change(
    path: DrivePath, progress: Progress, speed: float, free: bool, numbers: ExpertNumbers
) -> Progress:
    """Commits to the next lane change if its gap is free and its time has come.

    Not while the car is too fast for the room that there is.
    """
    k = progress.changes
    room = room_for_change(path, progress)
    too_fast = speed * QUICKEST_CHANGE_S > room
    if not free or too_fast or progress.station_m < path.change_jump_m[k]:
        waiting = progress.waiting_s
        if not free:
            waiting += numbers.dt_s
        return Progress(
            progress.station_m,
            k,
            progress.change_begin_m,
            progress.change_length_m,
            progress.line,
            progress.stood_s,
            waiting,
            progress.still_s,
            progress.yellow_s,
        )
    wanted = min(max(numbers.change_time_s * speed, CHANGE_ROOM_M), LONGEST_CHANGE_M)
    length = min(wanted, room)
    return Progress(
        progress.station_m,
        k + 1,
        progress.station_m,
        length,
        progress.line,
        progress.stood_s,
        0.0,
        progress.still_s,
        progress.yellow_s,
    )


@kernel
def slow_for_changes(
    path: DrivePath, progress: Progress, speed: float, numbers: ExpertNumbers
) -> float:
    """Acceleration so that the car is slow enough for the lane changes due, in their room."""
    k = progress.changes
    if k >= path.change_jump_m.size:
        return NO_LIMIT_MPS2
    ahead_m = max(path.change_jump_m[k] - progress.station_m, 0.0)
    if ahead_m > BEFORE_CHANGE_S * speed:
        return NO_LIMIT_MPS2
    there = room_for_change(path, progress) / QUICKEST_CHANGE_S
    allowed = math.sqrt(there * there + 2.0 * numbers.braking_mps2 * ahead_m)
    if allowed > LONGEST_CHANGE_M / QUICKEST_CHANGE_S:
        return NO_LIMIT_MPS2
    return max((allowed - speed) / numbers.dt_s, -numbers.braking_mps2)


@kernel
def wait_for_gap(
    path: DrivePath, progress: Progress, speed: float, beside: bool, numbers: ExpertNumbers
) -> float:
    """Acceleration while a lane change is due and its gap is not free."""
    latest = path.change_latest_m[progress.changes] - progress.station_m
    best = stop_within(latest, speed, numbers)
    if beside and speed > 3.0:
        best = min(best, MAKE_ROOM_MPS2)
    return best


@kernel
def decide(
    path: DrivePath,
    progress: Progress,
    crossings: Crossings,
    visible: Visible,
    numbers: ExpertNumbers,
    model: EgoParameters,
) -> tuple[float, float, float, Progress]:
    """The control of one decision.

    Args:
        path: The route's path.
        progress: The memory.
        crossings: Who may cross it, and where.
        visible: What is in sight.
        numbers: From `ExpertConfig`.
        model: From `EgoModel`.

    Returns:
        (throttle, steer, brake, memory).
    """
    x, y, yaw = visible.x[CAR], visible.y[CAR], visible.yaw[CAR]
    speed, half = visible.speed[CAR], visible.half_length[CAR]
    begun = update_progress(path, progress, visible, numbers)
    progress = taken_back(begun, speed)
    times = np.empty(FORECAST_M)
    forecast(path, progress.station_m, speed, numbers, times)
    ahead = junction_ahead(path, progress, half)
    sight = blank_sight()
    shift = change_due(path, progress, speed)
    if not numbers.ignore_actors:
        look(sight, path, progress, visible, shift, ahead, times, numbers)
    best = min(cruise(path, progress.station_m, speed, numbers), sight.number[BEST])
    best = min(best, slow_for_changes(path, progress, speed, numbers))
    if shift != 0.0:
        beside = sight.number[REAR_OK] == 0.0
        free = sight.number[FRONT_OK] == 1.0 and not beside
        was = progress.changes
        progress = begin_change(path, progress, speed, free, numbers)
        if progress.changes > was and progress.changes == begun.changes:
            progress = begun
        if not free:
            best = min(best, wait_for_gap(path, progress, speed, beside, numbers))
    queue = (sight.number[LEADER_REAR], sight.number[LEADER_SPEED])
    lines = line_acceleration(path, progress, visible, speed, half, times, queue, numbers)
    best = min(best, lines)
    if ahead.junction >= 0 and not numbers.ignore_actors:
        front = progress.station_m + half
        best = min(
            best,
            crossing_acceleration(crossings, progress, visible, ahead, times, numbers),
            exit_acceleration(sight, ahead.begin_m, front, half, speed, numbers),
        )
    best = min(max(best, -numbers.emergency_mps2), numbers.acceleration_mps2)
    throttle, brake = pedals(best, speed, model)
    steer = steering(path, progress, x, y, yaw, speed, model)
    return throttle, steer, brake, progress
