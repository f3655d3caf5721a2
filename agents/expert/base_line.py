"""The base line: a route's legs laid one behind the other, as one line of points.

It follows the new lane right from each lane change, to which it jumps sideways.
World frame; stations are along the line, or along a lane where they say so; offsets are positive to
the right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.expert.legs import Leg
from di_envs.numerics.arrays import Float64
from di_envs.town.lanes import Lanes

STEP_M = 0.5  # between path points
_REACH = 2  # points to each side, over which curvature is taken


class Points(NamedTuple):
    """Points (N,) of a line."""

    station_m: Float64
    x: Float64
    y: Float64
    z: Float64
    yaw: Float64


class LaidLeg(NamedTuple):
    """A leg, in stations of the base line."""

    lane: int
    begin_m: float
    end_m: float
    offset_m: float  # station on the line = station on the lane + offset


class Jump(NamedTuple):
    """Where the line leaves one lane and goes on along the next."""

    station_m: float
    shift_m: float  # the old lane's offset from the new one
    leg: int  # the first leg behind it


@dataclass
class BaseLine:
    """The line as far as it has been laid; the route ends at the end of its last leg."""

    pieces: list[Points]
    legs: list[LaidLeg]
    jumps: list[Jump]
    length_m: float = 0.0

    def points(self) -> Points:
        """All of it."""
        return Points(*map(np.concatenate, zip(*self.pieces, strict=True)))


def lay_out(runs: list[list[Leg]], lanes: Lanes) -> BaseLine:
    """Puts runs of linked legs one behind the other, each beginning beside the end of the last."""
    line = BaseLine([], [], [])
    for run in runs:
        if line.pieces:
            _jump_to(line, run[0], lanes)
        for leg in run:
            _lay_leg(line, leg, lanes)
    return line


def extend(line: BaseLine, legs: list[Leg], lanes: Lanes) -> None:
    """Adds linked legs at the end of a line; the first goes on with the line's last leg."""
    _lay_points(line, legs[0], lanes)
    line.legs[-1] = line.legs[-1]._replace(end_m=line.length_m)
    for leg in legs[1:]:
        _lay_leg(line, leg, lanes)


def _lay_leg(line: BaseLine, leg: Leg, lanes: Lanes) -> None:
    begin_m = line.length_m
    _lay_points(line, leg, lanes)
    line.legs.append(LaidLeg(leg.lane, begin_m, line.length_m, begin_m - leg.begin_m))


def _lay_points(line: BaseLine, leg: Leg, lanes: Lanes) -> None:
    points = _lane_points(lanes, leg)
    along = np.hypot(np.diff(points.x), np.diff(points.y))
    station = line.length_m + np.concatenate(([0.0], np.cumsum(along)))
    line.pieces.append(points._replace(station_m=station))
    line.length_m = float(station[-1])


def _jump_to(line: BaseLine, leg: Leg, lanes: Lanes) -> None:
    """Goes on along another lane; where that begins only further on, the line leads up to it."""
    x, y = float(line.pieces[-1].x[-1]), float(line.pieces[-1].y[-1])
    _begin_beside(leg, x, y, lanes)
    start = _lane_points(lanes, Leg(leg.lane, leg.begin_m, leg.begin_m))
    yaw = start.yaw[0]
    dx, dy = x - start.x[0], y - start.y[0]
    cos, sin = np.cos(yaw), np.sin(yaw)
    line.jumps.append(Jump(line.length_m, float(cos * dy - sin * dx), len(line.legs)))
    ahead_m = float(max(-(cos * dx + sin * dy), 0.0))
    if ahead_m > 0.0:
        line.pieces.append(
            Points(
                station_m=np.array([line.length_m]),
                x=start.x[:1] - ahead_m * cos,
                y=start.y[:1] - ahead_m * sin,
                z=start.z[:1],
                yaw=start.yaw[:1],
            )
        )
        line.length_m += ahead_m


def _begin_beside(leg: Leg, x: float, y: float, lanes: Lanes) -> None:
    """Moves a leg's begin, back or on, to the place on its lane that is beside (x, y)."""
    whole = Leg(leg.lane, 0.0, float(lanes.length_m[leg.lane]))
    points = _lane_points(lanes, whole)
    dx, dy = x - points.x, y - points.y
    along = dx * np.cos(points.yaw) + dy * np.sin(points.yaw)
    nearest = int(np.argmin(dx * dx + dy * dy))
    leg.begin_m = float(np.clip(points.station_m[nearest] + along[nearest], 0.0, whole.end_m))
    leg.end_m = max(leg.end_m, leg.begin_m)


def _lane_points(lanes: Lanes, leg: Leg) -> Points:
    """A leg's points, its two ends included; their stations are those along the lane."""
    first, count = int(lanes.first[leg.lane]), int(lanes.count[leg.lane])
    station = np.arange(count) * float(lanes.spacing_m[leg.lane])
    inner = station[(station > leg.begin_m + 1e-6) & (station < leg.end_m - 1e-6)]
    wanted = np.concatenate(([leg.begin_m], inner, [max(leg.end_m, leg.begin_m)]))
    points = lanes.points[first : first + count]
    x, y, z, yaw = (np.interp(wanted, station, points[:, column]) for column in range(4))
    return Points(wanted, x, y, z, yaw)


def resample(line: Points) -> Points:
    """The line at even stations. A jump's two points share a station: the later one counts."""
    station = np.arange(0.0, line.station_m[-1], STEP_M)
    index = np.searchsorted(line.station_m, station, side="right") - 1
    share = (station - line.station_m[index]) / (line.station_m[index + 1] - line.station_m[index])
    columns = (line.x, line.y, line.z, np.unwrap(line.yaw))
    x, y, z, yaw = (c[index] + share * (c[index + 1] - c[index]) for c in columns)
    return Points(station, x, y, z, yaw)


def curvature_of(yaw: Float64) -> Float64:
    """Change of yaw per metre over a metre to each side, so that joints do not jerk the wheel."""
    padded = np.pad(yaw, _REACH, mode="edge")
    slope = (padded[2 * _REACH :] - padded[: -2 * _REACH]) / (2 * _REACH * STEP_M)
    return np.ascontiguousarray(slope)
