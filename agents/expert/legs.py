"""The legs of a route: its lanes in order, without steps back, linked where they can be.

World frame; stations are along each leg's own lane.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from di_envs.numerics.geometry import wrap_angle
from di_envs.town.lanes import Lanes
from di_envs.town.plan import RoutePlan

BACK_STEP_M = 12.0  # a lane left again within this length, for the one before, is a step back
SHORT_LANE_M = 3.0  # lanes so short that points at 1 m may miss them
WANTED_ROOM_M = 35.0  # for a lane change; late ones are begun earlier than the route says
BEYOND_M = 80.0  # the path goes on behind the route's end, so that nobody brakes for the end


@dataclass
class Leg:
    """A stretch of one lane, in stations along the lane."""

    lane: int
    begin_m: float
    end_m: float


def legs_of(plan: RoutePlan) -> list[Leg]:
    """The lanes of a dense route in order, without its steps back."""
    legs: list[Leg] = []
    for lane, lane_m in zip(plan.lane.tolist(), plan.lane_m.tolist(), strict=True):
        if legs and legs[-1].lane == lane:
            legs[-1].end_m = max(legs[-1].end_m, lane_m)
        elif _steps_back(legs, lane, lane_m):
            legs.pop()
            legs[-1].end_m = max(legs[-1].end_m, lane_m)
        else:
            legs.append(Leg(lane, lane_m, lane_m))
    return legs


def _steps_back(legs: list[Leg], lane: int, lane_m: float) -> bool:
    """Whether a route point is back on the leg before the last, which then was but a step."""
    if len(legs) < 2 or legs[-2].lane != lane:
        return False
    short = legs[-1].end_m - legs[-1].begin_m < BACK_STEP_M
    return short and lane_m <= legs[-2].end_m + BACK_STEP_M


def join_legs(legs: list[Leg], lanes: Lanes) -> list[Leg]:
    """Fills in lanes without a route point, and stretches linked legs to their ends."""
    joined = [legs[0]]
    for leg in legs[1:]:
        joined.extend(Leg(lane, 0.0, 0.0) for lane in _skipped(lanes, joined[-1].lane, leg.lane))
        beside = _changed_to(lanes, joined[-1].lane, leg.lane)
        if beside >= 0:
            end_m = float(lanes.length_m[beside])
            joined.append(Leg(beside, end_m, end_m))
        joined.append(leg)
    for leg, following in pairwise(joined):
        if following.lane in _successors(lanes, leg.lane):
            leg.end_m = float(lanes.length_m[leg.lane])
            following.begin_m = 0.0
    return joined


def make_room(legs: list[Leg], lanes: Lanes) -> None:
    """Begins late lane changes earlier, on the lanes before too where one lane is too short."""
    for i in range(len(legs) - 1):
        if legs[i + 1].lane in _beside(lanes, legs[i].lane):
            _begin_earlier(legs, i, lanes)


def _begin_earlier(legs: list[Leg], i: int, lanes: Lanes) -> None:
    """Makes room for the change from leg `i` to the next, as far as there is any before it."""
    room, changes = 0.0, 0
    for before, after in pairwise(legs[i:]):
        if lanes.junction[after.lane] >= 0:
            break
        room += after.end_m - after.begin_m
        changes += after.lane not in _successors(lanes, before.lane)
    lacking = changes * WANTED_ROOM_M - room
    while lacking > 0.0:
        leg, following = legs[i], legs[i + 1]
        back = min(lacking, leg.end_m - leg.begin_m - 1.0)
        if back > 0.0:
            leg.end_m -= back
            following.begin_m = max(following.begin_m - back, 0.0)
            lacking -= back
        beside = _beside_the_lane_before(legs, i, lanes)
        if lacking <= 0.0 or beside < 0:
            break
        end_m = float(lanes.length_m[beside])
        lacking -= following.begin_m
        legs[i], following.begin_m = Leg(beside, end_m, end_m), 0.0
        i -= 1


def _beside_the_lane_before(legs: list[Leg], i: int, lanes: Lanes) -> int:
    """The lane on which to come to the leg behind leg `i` from the leg before, or -1.

    So that the change from leg `i`, which is used up, is made beside the leg before.
    """
    if i == 0 or legs[i].begin_m > 0.0 or lanes.junction[legs[i - 1].lane] >= 0:
        return -1
    if legs[i].lane not in _successors(lanes, legs[i - 1].lane):
        return -1
    left = lanes.left[legs[i].lane] == legs[i + 1].lane
    beside = int((lanes.left if left else lanes.right)[legs[i - 1].lane])
    return beside if beside >= 0 and legs[i + 1].lane in _successors(lanes, beside) else -1


def linked_runs(legs: list[Leg], lanes: Lanes) -> list[list[Leg]]:
    """Splits the legs where they are not linked end to start: where the lane changes."""
    runs = [[legs[0]]]
    for leg in legs[1:]:
        if leg.lane in _successors(lanes, runs[-1][-1].lane):
            runs[-1].append(leg)
        else:
            runs.append([leg])
    return runs


def legs_beyond(last: Leg, lanes: Lanes) -> list[Leg]:
    """What follows a route's last leg: the rest of its lane, then the straightest ways on."""
    length = float(lanes.length_m[last.lane])
    legs, room = [Leg(last.lane, last.end_m, length)], BEYOND_M - (length - last.end_m)
    lane = last.lane
    while room > 0.0:
        options = _successors(lanes, lane)
        if not options:
            break
        heading = _end_yaw(lanes, lane)
        bends = [abs(wrap_angle(_end_yaw(lanes, option) - heading)) for option in options]
        lane = options[int(np.argmin(bends))]
        length = float(lanes.length_m[lane])
        legs.append(Leg(lane, 0.0, length))
        room -= length
    return legs


def _end_yaw(lanes: Lanes, lane: int) -> float:
    return float(lanes.points[lanes.first[lane] + lanes.count[lane] - 1, 3])


def _successors(lanes: Lanes, lane: int) -> list[int]:
    span = slice(lanes.successor_start[lane], lanes.successor_start[lane + 1])
    return [int(other) for other in lanes.successor[span]]


def _beside(lanes: Lanes, lane: int) -> tuple[int, int]:
    return int(lanes.left[lane]), int(lanes.right[lane])


def _changed_to(lanes: Lanes, lane: int, target: int) -> int:
    """The lane beside `lane` that alone leads to `target`, in a junction; -1 where none does.

    Where a route changes lanes on the last metres before a junction, its next point is behind them.
    """
    if lanes.junction[target] < 0 or lanes.junction[lane] >= 0:
        return -1
    if target in _successors(lanes, lane):
        return -1
    return next((b for b in _beside(lanes, lane) if b >= 0 and target in _successors(lanes, b)), -1)


def _skipped(lanes: Lanes, lane: int, target: int) -> list[int]:
    """Up to two short lanes that link `lane` to `target`; none where they are linked already."""
    first = _successors(lanes, lane)
    if target in first:
        return []
    for a in first:
        if lanes.length_m[a] > SHORT_LANE_M:
            continue
        if target in _successors(lanes, a):
            return [a]
        for b in _successors(lanes, a):
            if lanes.length_m[b] <= SHORT_LANE_M and target in _successors(lanes, b):
                return [a, b]
    return []
