"""The line that the expert drives: a route's lanes made into one smooth path with target speeds.

A dense route jumps sideways where it changes lanes and may step back where keypoints join. Here
it becomes legs of lanes, then a *base line* sampled every half metre, which follows the new lane
right from each jump, and a list of *lane changes*. Until the expert commits to a change, its path
is the base line shifted by the change's offset, so that it can wait for a gap.
World frame; offsets are positive to the right.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.expert.config import ExpertConfig
from di_envs.town.lanes import Lanes
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town

STEP_M = 0.5  # between path points
BEYOND_M = 80.0  # the path goes on behind the route's end, so that nobody brakes for the end
BACK_STEP_M = 12.0  # a lane left again within this length, for the one before, is a step back
SHORT_LANE_M = 3.0  # lanes so short that points at 1 m may miss them
WANTED_ROOM_M = 35.0  # for a lane change; late ones are begun earlier than the route says
CHANGE_ROOM_M = 12.0  # shortest lane change
BEHIND_START_M = 5.0  # a stop line this far behind the start is still below the tail
CHANGE_END_M = 2.0  # lane changes end this far before the room for them does
WARY_BEFORE_M, WARY_BEHIND_M = 3.0, 17.0  # of a trigger of scenario 3, where somebody may step out
STEPS_OUT = 3  # its number


class DrivePath(NamedTuple):
    """The base line (P points at `STEP_M`), its legs (G), lane changes (C) and stop lines (Q)."""

    # (P,)
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    yaw: NDArray[np.float64]  # continuous, not wrapped
    curvature: NDArray[np.float64]  # 1/m, positive to the right
    speed_mps: NDArray[np.float64]  # target speed, reachable with the comfortable braking
    # (G,) in order of driving; a leg is a stretch of one lane
    leg_lane: NDArray[np.int32]
    leg_junction: NDArray[np.int32]  # junction of the leg's lane, -1 outside
    leg_begin_m: NDArray[np.float64]  # station of the leg's first point on the path
    leg_end_m: NDArray[np.float64]
    leg_offset_m: NDArray[np.float64]  # path station = lane station + offset
    # (C,)
    change_jump_m: NDArray[np.float64]  # where the base line jumps to the new lane
    change_latest_m: NDArray[np.float64]  # the change must begin before this station
    change_limit_m: NDArray[np.float64]  # and end before this one
    change_shift_m: NDArray[np.float64]  # old lane's offset from the new one
    # (Q,)
    line_m: NDArray[np.float64]  # station of the stop line
    line_signal: NDArray[np.int32]
    line_kind: NDArray[np.int8]  # SignalKind
    end_m: NDArray[np.float64]  # (1,) station of the route's last point


@dataclass
class Leg:
    """A stretch of one lane, in stations along the lane."""

    lane: int
    begin_m: float
    end_m: float


def build_path(plan: RoutePlan, town: Town, config: ExpertConfig) -> DrivePath:
    """Makes the path of a route.

    Args:
        plan: The dense route; it may jump sideways and step back.
        town: The town that it was planned in.
        config: Speeds and accelerations.
    """
    lanes = town.lanes
    legs = join_legs(legs_of(plan), lanes)
    _make_room(legs, lanes)
    final = legs[-1].end_m - float(plan.lane_m[-1])
    runs, changes_at = _runs(legs, lanes)
    line, leg_rows, jumps = _lay_out(runs, changes_at, lanes)
    total = leg_rows[-1][2]
    end_m = total - final
    extended = _extend(legs[-1], lanes)
    line, leg_rows = _append(line, leg_rows, extended, lanes)
    x, y, z, yaw = _resample(line)
    curvature = _curvature(yaw)
    legs_array = np.array(leg_rows)
    leg_lane = legs_array[:, 0].astype(np.int32)
    latest, limits = _change_room(jumps, legs_array, lanes)
    line_m, signal = _lines(legs_array, town)
    path = DrivePath(
        x=x,
        y=y,
        z=z,
        yaw=yaw,
        curvature=curvature,
        speed_mps=_speeds(_wary(plan, x, y, z, yaw, config), curvature, legs_array, lanes, config),
        leg_lane=leg_lane,
        leg_junction=lanes.junction[leg_lane].astype(np.int32),
        leg_begin_m=legs_array[:, 1].copy(),
        leg_end_m=legs_array[:, 2].copy(),
        leg_offset_m=legs_array[:, 3].copy(),
        change_jump_m=np.array([jump[0] for jump in jumps], np.float64),
        change_latest_m=latest,
        change_limit_m=limits,
        change_shift_m=np.array([jump[1] for jump in jumps], np.float64),
        line_m=line_m,
        line_signal=signal,
        line_kind=town.signals.kind[signal],
        end_m=np.array([end_m]),
    )
    for array in path:
        array.flags.writeable = False
    return path


def legs_of(plan: RoutePlan) -> list[Leg]:
    """The lanes of a dense route in order, without its steps back."""
    legs: list[Leg] = []
    for lane, lane_m in zip(plan.lane.tolist(), plan.lane_m.tolist(), strict=True):
        if legs and legs[-1].lane == lane:
            legs[-1].end_m = max(legs[-1].end_m, lane_m)
            continue
        before = legs[-2] if len(legs) > 1 else None
        if (
            before is not None
            and before.lane == lane
            and legs[-1].end_m - legs[-1].begin_m < BACK_STEP_M
            and lane_m <= before.end_m + BACK_STEP_M
        ):
            legs.pop()
            before.end_m = max(before.end_m, lane_m)
            continue
        legs.append(Leg(lane, lane_m, lane_m))
    return legs


def _successors(lanes: Lanes, lane: int) -> list[int]:
    span = slice(lanes.successor_start[lane], lanes.successor_start[lane + 1])
    return [int(other) for other in lanes.successor[span]]


def join_legs(legs: list[Leg], lanes: Lanes) -> list[Leg]:
    """Fills in lanes too short to have a route point, and stretches linked legs to their ends."""
    joined = [legs[0]]
    for leg in legs[1:]:
        joined.extend(Leg(lane, 0.0, 0.0) for lane in _skipped(lanes, joined[-1].lane, leg.lane))
        joined.append(leg)
    for leg, following in pairwise(joined):
        if following.lane in _successors(lanes, leg.lane):
            leg.end_m = float(lanes.length_m[leg.lane])
            following.begin_m = 0.0
    return joined


def _make_room(legs: list[Leg], lanes: Lanes) -> None:
    """Moves lane changes that come late to an earlier place on the same lane."""
    for i, (leg, following) in enumerate(pairwise(legs)):
        if following.lane not in (lanes.left[leg.lane], lanes.right[leg.lane]):
            continue
        room, changes = 0.0, 0
        for before, after in pairwise(legs[i:]):
            if lanes.junction[after.lane] >= 0:
                break
            room += after.end_m - after.begin_m
            changes += after.lane not in _successors(lanes, before.lane)
        back = min(changes * WANTED_ROOM_M - room, leg.end_m - leg.begin_m - 1.0)
        if back > 0.0:
            leg.end_m -= back
            following.begin_m = max(following.begin_m - back, 0.0)


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


def _runs(legs: list[Leg], lanes: Lanes) -> tuple[list[list[Leg]], list[int]]:
    """Splits the legs where they are not linked end to start; returns runs and their first legs."""
    runs, firsts = [[legs[0]]], [0]
    for i, leg in enumerate(legs[1:], start=1):
        if leg.lane in _successors(lanes, runs[-1][-1].lane):
            runs[-1].append(leg)
        else:
            runs.append([leg])
            firsts.append(i)
    return runs, firsts


def _lane_points(lanes: Lanes, leg: Leg) -> NDArray[np.float64]:
    """(N, 5) x, y, z, yaw and lane station of a leg's points, its two ends included."""
    first, count = int(lanes.first[leg.lane]), int(lanes.count[leg.lane])
    station = np.arange(count) * float(lanes.spacing_m[leg.lane])
    inner = station[(station > leg.begin_m + 1e-6) & (station < leg.end_m - 1e-6)]
    wanted = np.concatenate(([leg.begin_m], inner, [max(leg.end_m, leg.begin_m)]))
    points = lanes.points[first : first + count]
    columns = [np.interp(wanted, station, points[:, c]) for c in range(4)]
    return np.column_stack([*columns, wanted])


def _lay_out(
    runs: list[list[Leg]], firsts: list[int], lanes: Lanes
) -> tuple[NDArray[np.float64], list[list[float]], list[tuple[float, float, int]]]:
    """Puts the runs one after the other.

    Returns:
        The line, (N, 5) station, x, y, z, yaw; rows of lane, begin, end and offset of each leg; and
        station, old lane's offset and number of the first leg of each jump.
    """
    pieces: list[NDArray[np.float64]] = []
    rows: list[list[float]] = []
    jumps: list[tuple[float, float, int]] = []
    total = 0.0
    for run, first in zip(runs, firsts, strict=True):
        if pieces:
            old = pieces[-1][-1]
            shift, ahead = _land(run, old[1:], lanes)
            jumps.append((total, shift, first))
            if ahead > 0.0:  # the new lane begins only further on: lead up to it
                start = _lane_points(lanes, run[0])[0]
                back = start.copy()
                back[0] -= ahead * np.cos(start[3])
                back[1] -= ahead * np.sin(start[3])
                pieces.append(np.concatenate(([total], back[:4]))[None])
                total += ahead
        for leg in run:
            points = _lane_points(lanes, leg)
            along = np.hypot(np.diff(points[:, 0]), np.diff(points[:, 1]))
            station = total + np.concatenate(([0.0], np.cumsum(along)))
            pieces.append(np.column_stack([station, points[:, :4]]))
            rows.append([leg.lane, total, station[-1], total - leg.begin_m])
            total = float(station[-1])
    return np.concatenate(pieces), rows, jumps


def _land(run: list[Leg], old: NDArray[np.float64], lanes: Lanes) -> tuple[float, float]:
    """Starts a run beside the end of the old one.

    Moves the run's first leg back or on to the point beside `old` (x, y, z, yaw).

    Returns:
        The old lane's offset from the new one, and how far ahead the new lane begins [m].
    """
    leg = run[0]
    whole = Leg(leg.lane, 0.0, float(lanes.length_m[leg.lane]))
    points = _lane_points(lanes, whole)
    dx, dy = old[0] - points[:, 0], old[1] - points[:, 1]
    along = dx * np.cos(points[:, 3]) + dy * np.sin(points[:, 3])
    nearest = int(np.argmin(dx * dx + dy * dy))
    leg.begin_m = float(np.clip(points[nearest, 4] + along[nearest], 0.0, whole.end_m))
    leg.end_m = max(leg.end_m, leg.begin_m)
    start = _lane_points(lanes, Leg(leg.lane, leg.begin_m, leg.begin_m))[0]
    dx, dy = old[0] - start[0], old[1] - start[1]
    cos, sin = np.cos(start[3]), np.sin(start[3])
    return float(cos * dy - sin * dx), float(max(-(cos * dx + sin * dy), 0.0))


def _extend(last: Leg, lanes: Lanes) -> list[Leg]:
    """Lanes to go on with behind the route's end; straight on where there is a choice."""
    length = float(lanes.length_m[last.lane])
    legs, room = [Leg(last.lane, last.end_m, length)], BEYOND_M - (length - last.end_m)
    lane = last.lane
    while room > 0.0:
        options = _successors(lanes, lane)
        if not options:
            break
        heading = lanes.points[lanes.first[lane] + lanes.count[lane] - 1, 3]
        ends = [lanes.points[lanes.first[o] + lanes.count[o] - 1, 3] for o in options]
        bends = [abs((end - heading + np.pi) % (2.0 * np.pi) - np.pi) for end in ends]
        lane = options[int(np.argmin(bends))]
        length = float(lanes.length_m[lane])
        legs.append(Leg(lane, 0.0, length))
        room -= length
    return legs


def _append(
    line: NDArray[np.float64], rows: list[list[float]], legs: list[Leg], lanes: Lanes
) -> tuple[NDArray[np.float64], list[list[float]]]:
    """Adds linked legs at the end of the line; the first goes on with the line's last leg."""
    pieces, rows = [line], [list(row) for row in rows]
    total = float(line[-1, 0])
    for i, leg in enumerate(legs):
        points = _lane_points(lanes, leg)
        along = np.hypot(np.diff(points[:, 0]), np.diff(points[:, 1]))
        station = total + np.concatenate(([0.0], np.cumsum(along)))
        pieces.append(np.column_stack([station, points[:, :4]]))
        if i == 0:
            rows[-1][2] = station[-1]
        else:
            rows.append([leg.lane, total, station[-1], total - leg.begin_m])
        total = float(station[-1])
    return np.concatenate(pieces), rows


def _resample(line: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """x, y, z, yaw at even stations. A jump's two points share a station: the later one counts."""
    station = np.arange(0.0, line[-1, 0], STEP_M)
    index = np.searchsorted(line[:, 0], station, side="right") - 1
    share = (station - line[index, 0]) / (line[index + 1, 0] - line[index, 0])
    columns = (line[:, 1], line[:, 2], line[:, 3], np.unwrap(line[:, 4]))
    x, y, z, yaw = (c[index] + share * (c[index + 1] - c[index]) for c in columns)
    return x, y, z, yaw


def _curvature(yaw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Change of yaw per metre over a metre to each side, so that joints do not jerk the wheel."""
    reach = 2
    padded = np.pad(yaw, reach, mode="edge")
    slope = (padded[2 * reach :] - padded[: -2 * reach]) / (2 * reach * STEP_M)
    return np.ascontiguousarray(slope)


def _wary(
    plan: RoutePlan,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    z: NDArray[np.float64],
    yaw: NDArray[np.float64],
    config: ExpertConfig,
) -> NDArray[np.float64]:
    """Speeds where the plan says that somebody hides beside the road; else infinite."""
    speed = np.full(x.size, np.inf)
    past = 0
    for trigger in plan.scenarios:
        if trigger.type != STEPS_OUT:
            continue
        at = plan.points[trigger.point]
        away = (x - at[0]) ** 2 + (y - at[1]) ** 2 + (z - at[2]) ** 2
        away[np.cos(yaw - at[3]) < 0.5] = np.inf  # the path may cross itself there
        past += int(np.argmin(away[past:]))
        begin = max(past - int(WARY_BEFORE_M / STEP_M), 0)
        speed[begin : past + int(WARY_BEHIND_M / STEP_M)] = config.wary_mps
    return speed


def _speeds(
    wary: NDArray[np.float64],
    curvature: NDArray[np.float64],
    legs: NDArray[np.float64],
    lanes: Lanes,
    config: ExpertConfig,
) -> NDArray[np.float64]:
    """Speed limit and cornering speed, lowered where braking for what comes needs it."""
    station = np.arange(curvature.size) * STEP_M
    leg = np.clip(np.searchsorted(legs[:, 1], station, side="right") - 1, 0, len(legs) - 1)
    limit = lanes.speed_limit_mps[legs[leg, 0].astype(np.int64)] * config.limit_factor
    corner = np.sqrt(config.lateral_mps2 / np.maximum(np.abs(curvature), 1e-4))
    speed = np.minimum(np.minimum(limit, corner), wary)
    for i in range(speed.size - 2, -1, -1):
        reachable = np.sqrt(speed[i + 1] ** 2 + 2.0 * config.corner_braking_mps2 * STEP_M)
        speed[i] = min(speed[i], reachable)
    return speed


def _change_room(
    jumps: list[tuple[float, float, int]], legs: NDArray[np.float64], lanes: Lanes
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How long each lane change can wait: while the old lane runs beside, and before a junction.

    Returns:
        Stations by which each must begin, and by which it must have ended.
    """
    limits = [_room_end(first, shift, legs, lanes) for _, shift, first in jumps]
    latest = []
    for i, limit in enumerate(limits):
        left = sum(1 for j in range(i, len(jumps)) if jumps[j][0] < limit)
        latest.append(max(limit - CHANGE_END_M - left * CHANGE_ROOM_M, jumps[i][0]))
    return np.array(latest, np.float64), np.array(limits, np.float64)


def _room_end(first: int, shift: float, legs: NDArray[np.float64], lanes: Lanes) -> float:
    beside = lanes.right if shift > 0.0 else lanes.left
    for i in range(first, len(legs)):
        lane = int(legs[i, 0])
        if lanes.junction[lane] >= 0 or beside[lane] < 0:
            return float(legs[i, 1])
    return float(legs[-1, 2])


def _lines(legs: NDArray[np.float64], town: Town) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Stations and signals of the stop lines on the path, and of one just behind its start."""
    lanes, found = town.lanes, []
    lane, begin, _, offset = legs[0].tolist()
    if begin - offset < BEHIND_START_M:
        span = slice(lanes.predecessor_start[int(lane)], lanes.predecessor_start[int(lane) + 1])
        behind = [int(lanes.stop_line[other]) for other in lanes.predecessor[span]]
        found += [(offset, line) for line in behind[:1] if line >= 0]
    for lane, _, end, offset in legs.tolist():
        line = int(lanes.stop_line[int(lane)])
        if line >= 0 and abs(end - offset - float(lanes.length_m[int(lane)])) < 0.6:
            found.append((end, line))
    stations = np.array([station for station, _ in found], np.float64)
    lines = np.array([line for _, line in found], np.int32)
    return stations, town.signals.stop_signal[lines].astype(np.int32)
