"""People, seen from the expert's path: those who cross it, and those who may step out, as kernels.

A cyclist who crosses the road off all lanes is taken for somebody on foot, only faster.
"""

from __future__ import annotations

import math

from agents.expert.config import ExpertNumbers
from agents.expert.path import DrivePath
from agents.expert.progress import Progress
from agents.expert.sight import BEST, Seen, Sight
from agents.expert.speed import braking_needed, stop_within, time_to
from agents.expert.visible import CAR, Visible
from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel
from di_envs.world.state import ActorKind

AHEAD_OF_WALKER_S = 1.2  # by which the car is gone before somebody steps onto its path
TOO_LATE_MPS2 = 7.0  # who would have to brake harder than this does not stop for him
SPARE_S = 0.5  # kept between somebody's leaving the path and the expert's arrival
LOOK_S = 6.0
STANDS_MPS = 0.1  # who is slower than this stands
FACING = 0.7  # sine of the angle to the path above which somebody faces it
KERB_M = 12.0  # from the path, within which somebody who faces it may step out
WARY_MPS = 3.0  # past somebody who has not stepped out yet
WARY_MPS2 = 5.0  # with which the car can still stop for him
AT_CROSSWALK_M = 3.5  # along the path from a crosswalk's middle, within which people wait for it

_WALKER, _BICYCLE = int(ActorKind.WALKER), int(ActorKind.BICYCLE)


@kernel
def is_on_foot(visible: Visible, row: int) -> bool:
    """Whether somebody walks, or rides where there is no lane."""
    kind = visible.kind[row]
    return kind == _WALKER or (kind == _BICYCLE and visible.along_lane[row] == 0)


@kernel
def note_person(
    sight: Sight,
    path: DrivePath,
    visible: Visible,
    seen: Seen,
    progress: Progress,
    times: Float64,
    numbers: ExpertNumbers,
) -> None:
    """Stops before somebody on the path, or who will be when the car is there; else is wary.

    Those who wait at crosswalks look out themselves before they step onto the road.
    """
    _note_crossing(sight, visible, seen, progress, times, numbers)
    if visible.speed[seen.row] < STANDS_MPS and not _is_at_crosswalk(path, seen.station_m):
        _note_waiting(sight, visible, seen, progress, numbers)


@kernel
def _note_crossing(
    sight: Sight,
    visible: Visible,
    seen: Seen,
    progress: Progress,
    times: Float64,
    numbers: ExpertNumbers,
) -> None:
    """Stops before somebody on the path, or who will be when the car is there."""
    station, offset = seen.station_m, seen.offset_m
    across = visible.speed[seen.row] * math.sin(seen.turn_rad)
    along = visible.speed[seen.row] * math.cos(seen.turn_rad)
    half, body = visible.half_length[CAR], visible.half_length[seen.row]
    reach = visible.half_width[CAR] + body + numbers.walker_margin_m
    enters, leaves, slack = 0.0, LOOK_S, 0.0
    if abs(across) > 0.2:
        towards = -math.copysign(offset, offset * across)  # positive while coming nearer
        enters = max((towards - reach) / abs(across), 0.0)
        leaves = (towards + reach) / abs(across)
        slack = numbers.walker_margin_m / abs(across)
    if (abs(offset) >= reach and abs(across) <= 0.2) or leaves <= 0.0 or enters > LOOK_S:
        return
    meeting = station + along * min(enters, 2.0)
    distance = meeting - body - progress.station_m - half
    if distance < 0.0 and abs(offset) > visible.half_width[CAR] + body:
        return  # beside the car: it only gets out of that walker's way by going on
    if station + body < progress.station_m:
        return
    arrives = time_to(times, distance - 0.5)
    gone = time_to(times, meeting + body + half + 0.5 - progress.station_m)
    if arrives > leaves + SPARE_S or gone + AHEAD_OF_WALKER_S < enters:
        return
    passed = time_to(times, meeting + body - progress.station_m)
    if passed < enters + slack and braking_needed(distance, visible.speed[CAR]) > TOO_LATE_MPS2:
        return  # it can no longer stop, but its middle is past him before he is there
    stop = stop_within(distance - numbers.walker_gap_m, visible.speed[CAR], numbers)
    sight.number[BEST] = min(sight.number[BEST], stop)


@kernel
def _note_waiting(
    sight: Sight, visible: Visible, seen: Seen, progress: Progress, numbers: ExpertNumbers
) -> None:
    """Slows down for somebody who stands beside the road and faces it: he may step out."""
    offset, sine = seen.offset_m, math.sin(seen.turn_rad)
    towards = -math.copysign(sine, offset * sine)  # 1 straight at the path
    if towards < FACING or abs(offset) > KERB_M:
        return
    speed = visible.speed[CAR]
    rear = seen.station_m - visible.half_length[seen.row]
    distance = rear - progress.station_m - visible.half_length[CAR]
    if distance < 0.0:
        return
    step = WARY_MPS2 * numbers.dt_s
    room = max(distance - numbers.walker_gap_m, 0.0)
    allowed = max(math.sqrt(step * step + 2.0 * WARY_MPS2 * room) - step, WARY_MPS)
    wanted = max((allowed - speed) / numbers.dt_s, -WARY_MPS2)
    sight.number[BEST] = min(sight.number[BEST], wanted)


@kernel
def _is_at_crosswalk(path: DrivePath, station_m: float) -> bool:
    """Whether a place beside the path is at a crosswalk over it."""
    for k in range(path.crosswalk_m.size):
        if abs(path.crosswalk_m[k] - station_m) < AT_CROSSWALK_M:
            return True
    return False
