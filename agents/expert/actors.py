"""Everybody else, seen from the expert's path: leaders and gaps, as kernels."""

from __future__ import annotations

import math

from agents.expert.line import height_at, project
from agents.expert.path import STEP_M
from agents.expert.people import SPARE_S, is_on_foot, note_person
from agents.expert.sight import (
    BEST,
    FRONT_OK,
    INSIDE_M,
    LEADER_REAR,
    LEADER_SPEED,
    REAR_OK,
    ROOM_M,
)
from agents.expert.speed import follow
from di_envs.numerics.geometry import wrap_angle
from di_envs.numerics.kernels import kernel
from di_envs.world.state import ActorKind

LEVEL_M = 3.0  # whoever is further above or below is on another level
LOOK_M, LOOK_S = 35.0, 4.0  # others are looked at within this and the way driven in this time
BACK_M = 60.0  # of path behind the car, where followers are
CROSSING_RAD = 0.6  # whoever stands at more than this angle to the path crosses it
LEADER_BRAKING_MPS2 = 8.0  # what the vehicle ahead may do
BLOCKED_GAP_M = 1.5
# Behind a leader, that a change to the next lane takes from standstill: on the shortest change the
# car's front swings out beside a lorry with 0.3 m to spare, as its rear axle follows the path
PULL_OUT_M = 6.0
PATIENT_S = 4.0  # of waiting for a gap, after which a smaller one will do

_ABSENT, _PROP, _DEBRIS = (
    int(kind) for kind in (ActorKind.ABSENT, ActorKind.PROP, ActorKind.DEBRIS)
)


@kernel
def behind_leader(gap_m, speed, leader_speed, numbers):
    """Acceleration behind a leader: the driver model's, and never too fast to stop behind it."""
    room = max(gap_m - 0.7, 0.0) + leader_speed * leader_speed / (2.0 * LEADER_BRAKING_MPS2)
    braking = numbers.emergency_mps2 - 1.0
    step = braking * numbers.dt_s
    safe = -step + math.sqrt(step * step + 2.0 * braking * room)
    return min(
        follow(gap_m, speed, leader_speed, numbers),
        max((safe - speed) / numbers.dt_s, -numbers.emergency_mps2),
    )


@kernel
def _note_vehicle(sight, actors, actor, ego, station, offset, turn, progress, shift, span, numbers):
    """Follows a vehicle on the path; notes gaps beside it and room beyond the junction."""
    number, speed = sight.number, actors.speed[ego]
    cos, sin = math.cos(turn), math.sin(turn)
    length = actors.half_length[actor] * abs(cos) + actors.half_width[actor] * abs(sin)
    width = actors.half_length[actor] * abs(sin) + actors.half_width[actor] * abs(cos)
    along, across = actors.speed[actor] * cos, actors.speed[actor] * sin
    half = actors.half_length[ego]
    rear, front = station - length, station + length
    # A vehicle that changes lanes counts on the lane that it leaves and on the one that it enters.
    aside = offset - actors.lateral_m[actor] if actors.changing_from[actor] >= 0 else offset
    if shift != 0.0:
        beside = min(abs(offset + shift), abs(aside + shift)) - width
        if beside < actors.half_width[ego] + 0.2:
            _note_gap(sight, actors, ego, rear, front, along, progress, numbers)
    reach = actors.half_width[ego] + width
    if actors.kind[actor] < _PROP:  # poles stand close to where one drives, and stay there
        reach += numbers.side_margin_m
    if min(abs(offset), abs(aside)) >= reach or front <= progress.station_m:
        return
    gap = rear - progress.station_m - half
    if shift != 0.0 and along < speed + 1.0:  # it must pull out behind this one
        if gap < PULL_OUT_M:
            number[FRONT_OK] = 0.0
        gap -= PULL_OUT_M - numbers.standstill_gap_m
    if abs(turn) > CROSSING_RAD and abs(across) > 1.0:
        leaving = (reach - math.copysign(offset, across * offset)) / abs(across)
        if gap > (leaving + SPARE_S) * speed + BLOCKED_GAP_M:
            return
    number[BEST] = min(number[BEST], behind_leader(gap, speed, max(along, 0.0), numbers))
    if rear < number[LEADER_REAR]:
        number[LEADER_REAR] = rear
        number[LEADER_SPEED] = max(along, 0.0)
    if rear > span[1]:
        number[ROOM_M] = min(number[ROOM_M], rear + along * along / 8.0 - span[1])
    elif front > span[0]:
        number[INSIDE_M] += 2.0 * actors.half_length[actor] + numbers.exit_gap_m


@kernel
def _note_gap(sight, actors, ego, rear, front, along, progress, numbers):
    """Whether a vehicle on the lane to change to leaves the gap free."""
    speed, half = actors.speed[ego], actors.half_length[ego]
    ahead = rear - progress.station_m - half
    behind = progress.station_m - half - front
    if rear + front > 2.0 * progress.station_m:
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
def look(sight, path, progress, actors, ways, ego, shift, span, junction, times, numbers):
    """Looks at all actors near the car.

    Args:
        sight: From `blank_sight`; filled.
        shift: Offset of the present lane from the one to change to next, 0 where none is due.
        span: Stations where the next junction begins and ends.
        junction: Index of the junction that the car is on or comes to next, -1 for none.
        times: From `forecast`.
    """
    speed = actors.speed[ego]
    reach = LOOK_M + LOOK_S * speed
    here = int(progress.station_m / STEP_M)
    begin = max(here - int(BACK_M / STEP_M), 0)
    end = min(here + int(reach / STEP_M) + 8, path.x.size)
    for actor in range(actors.kind.size):
        kind = actors.kind[actor]
        if actor == ego or kind in (_ABSENT, _DEBRIS):
            continue
        dx, dy = actors.x[actor] - actors.x[ego], actors.y[actor] - actors.y[ego]
        if dx * dx + dy * dy > reach * reach:
            continue
        station, offset, yaw = project(path, progress, actors.x[actor], actors.y[actor], begin, end)
        # Levels are those of the path there: roads climb.
        if abs(actors.z[actor] - height_at(path, station)) > LEVEL_M:
            continue
        turn = wrap_angle(actors.yaw[actor] - yaw)
        if is_on_foot(actors, actor):
            note_person(sight, actors, actor, ego, station, offset, turn, progress, times, numbers)
            continue
        _note_vehicle(
            sight, actors, actor, ego, station, offset, turn, progress, shift, span, numbers
        )
        way = actors.grant[actor]
        if way >= 0 and ways.junction[way] == junction and sight.holders[0] < sight.holder.size:
            sight.holder[sight.holders[0]] = actor
            sight.holders[0] += 1
