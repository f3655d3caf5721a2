"""Everybody else, seen from the expert's path: leaders and gaps, as kernels."""

from __future__ import annotations

import math
from typing import NamedTuple

from agents.expert.base_line import STEP_M
from agents.expert.config import ExpertNumbers
from agents.expert.hiding import note_hiding_place
from agents.expert.junction import JunctionAhead
from agents.expert.path import DrivePath
from agents.expert.people import SPARE_S, is_on_foot, note_person
from agents.expert.progress import Progress, height_at, lane_after_change, project, shift_at
from agents.expert.sight import (
    BEST,
    FRONT_OK,
    INSIDE_M,
    LEADER_REAR,
    LEADER_SPEED,
    REAR_OK,
    ROOM_M,
    Seen,
    Sight,
)
from agents.expert.speed import follow
from agents.expert.visible import CAR, Visible
from di_envs.numerics.arrays import Float64
from di_envs.numerics.geometry import wrap_angle
from di_envs.numerics.kernels import kernel
from di_envs.world.state import ActorKind

LEVEL_M = 3.0  # whoever is further above or below is on another level
LOOK_M, LOOK_S = 35.0, 4.0  # others are looked at within this and the way driven in this time
CHANGE_LOOK_M = 100.0  # and within this where lanes are to be changed: who comes may be fast
BACK_M = 60.0  # of path behind the car, where followers are
CROSSING_RAD = 0.6  # whoever stands at more than this angle to the path crosses it
LEADER_BRAKING_MPS2 = 8.0  # what the vehicle ahead may do
DRIFT_RAD = 0.02  # of heading to the side of the indicator, from which on a change is under way
CHANGE_M = 3.0  # to the side, where it leads
BLOCKED_GAP_M = 1.5
# Behind a leader, that a change to the next lane takes from standstill: on the shortest change the
# car's front swings out beside a lorry with 0.3 m to spare, as its rear axle follows the path
PULL_OUT_M = 6.0
PATIENT_S = 4.0  # of waiting for a gap, after which a smaller one will do

_PROP = int(ActorKind.PROP)


@kernel
def behind_leader(gap_m: float, speed: float, leader_speed: float, numbers: ExpertNumbers) -> float:
    """Acceleration behind a leader: the driver model's, and never too fast to stop behind it."""
    room = max(gap_m - 0.7, 0.0) + leader_speed * leader_speed / (2.0 * LEADER_BRAKING_MPS2)
    braking = numbers.emergency_mps2 - 1.0
    step = braking * numbers.dt_s
    safe = -step + math.sqrt(step * step + 2.0 * braking * room)
    return min(
        follow(gap_m, speed, leader_speed, numbers),
        max((safe - speed) / numbers.dt_s, -numbers.emergency_mps2),
    )


class Shadow(NamedTuple):
    """A vehicle laid onto the path: the stretch that it covers, and how it moves there."""

    rear_m: float  # stations of the path
    front_m: float
    half_width_m: float  # across the path
    offset_m: float  # of its middle …
    aside_m: float  # … and where a change of lanes will lead it
    along_mps: float
    across_mps: float


@kernel
def _shadow_of(visible: Visible, seen: Seen, ahead: JunctionAhead) -> Shadow:
    """A vehicle laid onto the path.

    One that changes lanes counts where it is and where its indicator and its heading lead it.
    Beside the car in a junction both say that it turns as the car does.
    """
    row = seen.row
    cos, sin = math.cos(seen.turn_rad), math.sin(seen.turn_rad)
    half_length, half_width = visible.half_length[row], visible.half_width[row]
    length = half_length * abs(cos) + half_width * abs(sin)
    aside = seen.offset_m
    drifts = visible.indicator[row] * seen.turn_rad > DRIFT_RAD
    turns = ahead.begin_m < seen.station_m + length and seen.station_m - length < ahead.end_m
    if drifts and not turns and abs(seen.turn_rad) < CROSSING_RAD:
        aside += visible.indicator[row] * CHANGE_M
    return Shadow(
        seen.station_m - length,
        seen.station_m + length,
        half_length * abs(sin) + half_width * abs(cos),
        seen.offset_m,
        aside,
        visible.speed[row] * cos,
        visible.speed[row] * sin,
    )


@kernel
def _note_vehicle(
    sight: Sight,
    path: DrivePath,
    visible: Visible,
    seen: Seen,
    progress: Progress,
    shift: float,
    ahead: JunctionAhead,
    numbers: ExpertNumbers,
) -> None:
    """Follows a vehicle on the path; notes gaps beside it and room beyond the junction.

    Args:
        sight: What the car knows so far; changed.
        path: The route's path.
        visible: What is in sight.
        seen: The vehicle.
        progress: Where the car is on the path.
        shift: As of `look`.
        ahead: The next junction.
        numbers: From `ExpertConfig`.
    """
    shadow = _shadow_of(visible, seen, ahead)
    if shift != 0.0:
        here, _, _ = shift_at(path, progress, seen.station_m)
        lane = lane_after_change(path, progress.changes, seen.station_m)
        if _is_beside(shadow, here - lane, visible.half_width[CAR]):
            _note_gap(sight, visible, shadow, progress, numbers)
    reach = visible.half_width[CAR] + shadow.half_width_m
    if visible.kind[seen.row] < _PROP:  # poles stand close to where one drives, and stay there
        reach += numbers.side_margin_m
    on_path = min(abs(shadow.offset_m), abs(shadow.aside_m)) < reach
    if not on_path or shadow.front_m <= progress.station_m:
        return
    speed = visible.speed[CAR]
    gap = shadow.rear_m - progress.station_m - visible.half_length[CAR]
    if shift != 0.0 and shadow.along_mps < speed + 1.0:  # it must pull out behind this one
        if gap < PULL_OUT_M:
            sight.number[FRONT_OK] = 0.0
        gap -= PULL_OUT_M - numbers.standstill_gap_m
    if abs(seen.turn_rad) > CROSSING_RAD and _is_gone_by_then(shadow, reach, gap, speed):
        return
    _note_leader(sight, shadow, gap, speed, numbers)
    _note_room(sight, shadow, 2.0 * visible.half_length[seen.row], ahead, numbers)


@kernel
def _is_beside(shadow: Shadow, shift: float, half_width: float) -> bool:
    """Whether a vehicle is on the lane to change to, in the way of a car that is so wide.

    `shift` is the offset of the path from that lane where the vehicle is.
    """
    off_lane = min(abs(shadow.offset_m + shift), abs(shadow.aside_m + shift))
    return off_lane - shadow.half_width_m < half_width + 0.2


@kernel
def _is_gone_by_then(shadow: Shadow, reach: float, gap: float, speed: float) -> bool:
    """Whether a vehicle that crosses the path has left it, `reach` wide, when the car comes."""
    across = abs(shadow.across_mps)
    if across <= 1.0:
        return False
    leaving = (reach - math.copysign(shadow.offset_m, shadow.across_mps * shadow.offset_m)) / across
    return gap > (leaving + SPARE_S) * speed + BLOCKED_GAP_M


@kernel
def _note_leader(
    sight: Sight, shadow: Shadow, gap: float, speed: float, numbers: ExpertNumbers
) -> None:
    """Keeps behind a vehicle on the path, and remembers the nearest one."""
    number, leader_speed = sight.number, max(shadow.along_mps, 0.0)
    number[BEST] = min(number[BEST], behind_leader(gap, speed, leader_speed, numbers))
    if shadow.rear_m < number[LEADER_REAR]:
        number[LEADER_REAR] = shadow.rear_m
        number[LEADER_SPEED] = leader_speed


@kernel
def _note_room(
    sight: Sight, shadow: Shadow, length: float, ahead: JunctionAhead, numbers: ExpertNumbers
) -> None:
    """Notes how far behind the junction a vehicle is, or that one inside will need room there."""
    number = sight.number
    if shadow.rear_m > ahead.end_m:
        along = shadow.along_mps
        number[ROOM_M] = min(number[ROOM_M], shadow.rear_m + along * along / 8.0 - ahead.end_m)
    elif shadow.front_m > ahead.begin_m:
        number[INSIDE_M] += length + numbers.exit_gap_m


@kernel
def _note_gap(
    sight: Sight,
    visible: Visible,
    shadow: Shadow,
    progress: Progress,
    numbers: ExpertNumbers,
) -> None:
    """Whether a vehicle on the lane to change to leaves the gap free."""
    speed, half, along = visible.speed[CAR], visible.half_length[CAR], shadow.along_mps
    ahead = shadow.rear_m - progress.station_m - half
    behind = progress.station_m - half - shadow.front_m
    if shadow.rear_m + shadow.front_m > 2.0 * progress.station_m:
        braking = -follow(max(ahead, 0.1), speed, along, numbers)
        if ahead < BLOCKED_GAP_M or braking > numbers.change_front_mps2:
            sight.number[FRONT_OK] = 0.0
    else:
        patience = 2.0 if progress.waiting_s > PATIENT_S else 1.0
        closing = max(along - speed, 0.0)
        wanted = BLOCKED_GAP_M + 0.6 * along / patience
        wanted += closing * closing / (2.0 * patience * numbers.change_rear_mps2)
        if behind < wanted:
            sight.number[REAR_OK] = 0.0


@kernel
def look(
    sight: Sight,
    path: DrivePath,
    progress: Progress,
    visible: Visible,
    shift: float,
    ahead: JunctionAhead,
    times: Float64,
    numbers: ExpertNumbers,
) -> None:
    """Looks at all actors near the car.

    Args:
        sight: From `blank_sight`; filled.
        path: The route's path.
        progress: Where the car is on it.
        visible: What is in sight.
        shift: Offset of the present lane from the one to change to next [m], 0 where none is due.
        ahead: The next junction.
        times: From `forecast`.
        numbers: From `ExpertConfig`.
    """
    reach, back = LOOK_M + LOOK_S * visible.speed[CAR], BACK_M
    if shift != 0.0:
        reach, back = max(reach, CHANGE_LOOK_M), CHANGE_LOOK_M
    here = int(progress.station_m / STEP_M)
    begin = max(here - int(back / STEP_M), 0)
    end = min(here + int(reach / STEP_M) + 8, path.x.size)
    for row in range(CAR + 1, visible.seen[0]):
        dx, dy = visible.x[row] - visible.x[CAR], visible.y[row] - visible.y[CAR]
        if dx * dx + dy * dy > reach * reach:
            continue
        station, offset, yaw = project(path, progress, visible.x[row], visible.y[row], begin, end)
        # Levels are those of the path there: roads climb.
        if abs(visible.z[row] - height_at(path, station)) > LEVEL_M:
            continue
        seen = Seen(row, station, offset, wrap_angle(visible.yaw[row] - yaw))
        if is_on_foot(visible, row):
            note_person(sight, path, visible, seen, progress, times, numbers)
            continue
        note_hiding_place(sight, visible, seen, progress, numbers)
        _note_vehicle(sight, path, visible, seen, progress, shift, ahead, numbers)
