"""The path that the expert drives: a route's lanes made into one smooth line with target speeds.

A dense route jumps sideways where it changes lanes and may step back where keypoints join. Here it
becomes legs of lanes (`legs`), then a base line sampled every half metre (`base_line`), with target
speeds (`target_speed`), a list of lane changes and one of stop lines. Until the expert commits to a
change, its path is the base line shifted by the change's offset, so that it can wait for a gap.
World frame; offsets are positive to the right.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agents.expert.base_line import (
    BaseLine,
    Jump,
    LaidLeg,
    curvature_of,
    extend,
    lay_out,
    resample,
)
from agents.expert.config import ExpertConfig
from agents.expert.legs import join_legs, legs_beyond, legs_of, linked_runs, make_room
from agents.expert.target_speed import target_speeds
from di_envs.numerics.arrays import Float64, Int8, Int32
from di_envs.town.lanes import Lanes
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town

CHANGE_ROOM_M = 12.0  # shortest lane change
CHANGE_END_M = 2.0  # lane changes end this far before the room for them does
BEHIND_START_M = 5.0  # a stop line this far behind the start is still below the tail
_AT_END_M = 0.6  # from a lane's end, within which a leg reaches its stop line


class DrivePath(NamedTuple):
    """The base line (P points at `STEP_M`), its legs (G), lane changes (C) and stop lines (Q)."""

    # (P,)
    x: Float64
    y: Float64
    z: Float64
    yaw: Float64  # continuous, not wrapped
    curvature: Float64  # 1/m, positive to the right
    speed_mps: Float64  # target speed, reachable with the comfortable braking
    # (G,) in order of driving; a leg is a stretch of one lane
    leg_lane: Int32
    leg_junction: Int32  # junction of the leg's lane, -1 outside
    leg_begin_m: Float64  # station of the leg's first point on the path
    leg_end_m: Float64
    leg_offset_m: Float64  # path station = lane station + offset
    # (C,)
    change_jump_m: Float64  # where the base line jumps to the new lane
    change_latest_m: Float64  # the change must begin before this station
    change_limit_m: Float64  # and end before this one
    change_shift_m: Float64  # old lane's offset from the new one
    # (Q,)
    line_m: Float64  # station of the stop line
    line_signal: Int32
    line_kind: Int8  # SignalKind
    crosswalk_m: Float64  # (X,) stations of the middles of crosswalks over the path
    end_m: Float64  # (1,) station of the route's last point


def build_path(plan: RoutePlan, town: Town, config: ExpertConfig, told: bool = False) -> DrivePath:
    """Makes the path of a route.

    Args:
        plan: The dense route; it may jump sideways and step back.
        town: The town that it was planned in.
        config: Speeds and accelerations.
        told: Whether the driver knows where scenarios will begin.
    """
    lanes = town.lanes
    legs = join_legs(legs_of(plan), lanes)
    make_room(legs, lanes)
    beyond_m = legs[-1].end_m - float(plan.lane_m[-1])  # of the last leg, behind the route's end
    line = lay_out(linked_runs(legs, lanes), lanes)
    end_m = line.length_m - beyond_m
    extend(line, legs_beyond(legs[-1], lanes), lanes)
    points = resample(line.points())
    curvature = curvature_of(points.yaw)
    speeds = target_speeds(plan, points, curvature, line.legs, lanes, config, told)
    leg_lane = np.array([leg.lane for leg in line.legs], np.int32)
    limits = [_room_end(jump, line.legs, lanes) for jump in line.jumps]
    stations, signal = _stop_lines(line.legs, town)
    path = DrivePath(
        x=points.x,
        y=points.y,
        z=points.z,
        yaw=points.yaw,
        curvature=curvature,
        speed_mps=speeds,
        leg_lane=leg_lane,
        leg_junction=lanes.junction[leg_lane].astype(np.int32),
        leg_begin_m=np.array([leg.begin_m for leg in line.legs]),
        leg_end_m=np.array([leg.end_m for leg in line.legs]),
        leg_offset_m=np.array([leg.offset_m for leg in line.legs]),
        change_jump_m=np.array([jump.station_m for jump in line.jumps], np.float64),
        change_latest_m=np.array(_latest_begins(line, limits), np.float64),
        change_limit_m=np.array(limits, np.float64),
        change_shift_m=np.array([jump.shift_m for jump in line.jumps], np.float64),
        line_m=stations,
        line_signal=signal,
        line_kind=town.signals.kind[signal],
        crosswalk_m=_crosswalks(line.legs, town),
        end_m=np.array([end_m]),
    )
    for array in path:
        array.flags.writeable = False
    return path


def _room_end(jump: Jump, legs: list[LaidLeg], lanes: Lanes) -> float:
    """By which station a lane change must have ended: with the old lane, or at a junction."""
    beside = lanes.right if jump.shift_m > 0.0 else lanes.left
    for leg in legs[jump.leg :]:
        if lanes.junction[leg.lane] >= 0 or beside[leg.lane] < 0:
            return leg.begin_m
    return legs[-1].end_m


def _latest_begins(line: BaseLine, limits: list[float]) -> list[float]:
    """By which stations lane changes must begin, to leave those behind them their room."""
    latest = []
    for i, limit in enumerate(limits):
        left = sum(1 for jump in line.jumps[i:] if jump.station_m < limit)
        latest.append(max(limit - CHANGE_END_M - left * CHANGE_ROOM_M, line.jumps[i].station_m))
    return latest


def _stop_lines(legs: list[LaidLeg], town: Town) -> tuple[Float64, Int32]:
    """Stations and signals of the stop lines on the path, and of one just behind its start."""
    lanes = town.lanes
    found = _line_behind_start(legs[0], lanes)
    for leg in legs:
        line = int(lanes.stop_line[leg.lane])
        lane_m = leg.end_m - leg.offset_m
        if line >= 0 and abs(lane_m - float(lanes.length_m[leg.lane])) < _AT_END_M:
            found.append((leg.end_m, line))
    stations = np.array([station for station, _ in found], np.float64)
    lines = np.array([line for _, line in found], np.int32)
    return stations, town.signals.stop_signal[lines].astype(np.int32)


def _crosswalks(legs: list[LaidLeg], town: Town) -> Float64:
    """Stations of the middles of crosswalks over the legs."""
    walks = town.crosswalks
    middle = 0.5 * (walks.crossed_begin_m + walks.crossed_end_m)
    found = [middle[walks.crossed_lane == leg.lane] + leg.offset_m for leg in legs]
    return np.sort(np.concatenate(found))


def _line_behind_start(first: LaidLeg, lanes: Lanes) -> list[tuple[float, int]]:
    """The stop line below the car's tail at the start, if there is one: (station, line)."""
    if first.begin_m - first.offset_m >= BEHIND_START_M:
        return []
    span = slice(lanes.predecessor_start[first.lane], lanes.predecessor_start[first.lane + 1])
    behind = [int(lanes.stop_line[other]) for other in lanes.predecessor[span]]
    return [(first.offset_m, line) for line in behind[:1] if line >= 0]
