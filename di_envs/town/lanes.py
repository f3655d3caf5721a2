"""The lane network as arrays: what kernels read of a town.

World frame: x east, y south, z up [m]; yaw clockwise [rad]. Lanes of all kinds are here; links,
neighbours, turns and conflicts join driving lanes. A lane's points run in its direction of travel
(for lanes without one: along the road) at even spacing `length_m / (count - 1)`, at most 0.5 m.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from di_envs.numerics.arrays import Float64, Int8, Int32
from di_envs.numerics.bundles import by_reference


class LaneKind(IntEnum):
    """What a lane is for; OpenDRIVE's other types are OTHER."""

    OTHER = 0
    DRIVING = 1
    PARKING = 2
    SHOULDER = 3
    SIDEWALK = 4
    BIKING = 5


class Turn(IntEnum):
    """Where a lane inside a junction leads; values as in CARLA's RoadOption."""

    NONE = 0
    LEFT = 1
    RIGHT = 2
    STRAIGHT = 3


@by_reference
class Lanes(NamedTuple):
    """Arrays over L lanes, P points, N successor links, C conflicts."""

    # (L,) one row a lane
    kind: Int8  # LaneKind
    road: Int32  # index into Town.road_names
    # Lane sections through which a road's driving lanes go on one to one are one lane here
    section: Int32  # OpenDRIVE lane section within the road, the first of those joined
    lane_id: Int32  # OpenDRIVE lane id in that section
    junction: Int32  # index into Town.junction_names, -1 outside junctions
    turn: Int8  # Turn, for driving lanes inside junctions
    length_m: Float64
    spacing_m: Float64  # between points, along the lane
    longest_step_m: Float64  # the greatest distance between two neighbours, seen from above
    speed_limit_mps: Float64
    first: Int32  # first point
    count: Int32  # type: ignore[assignment]  # number of points, at least 2
    left: Int32  # driving lane beside it in the same direction and section, -1 where there is none
    right: Int32
    stop_line: Int32  # index into Signals' stop lines at this lane's end, -1 where there is none
    # links between driving lanes: those of lane i are [start[i], start[i + 1])
    successor_start: Int32  # (L + 1,)
    successor: Int32  # (N,)
    predecessor_start: Int32  # (L + 1,)
    predecessor: Int32  # (N,)
    # places where lanes of one junction come within 3 m of each other, both ways round:
    # lane i between [begin_m, end_m) meets `conflict_lane` between [other_begin_m, other_end_m)
    conflict_start: Int32  # (L + 1,)
    conflict_lane: Int32  # (C,)
    conflict_begin_m: Float64  # (C,)
    conflict_end_m: Float64
    conflict_other_begin_m: Float64
    conflict_other_end_m: Float64
    # (P, 4) x, y, z, yaw; yaw is continuous along a lane (not wrapped)
    points: Float64
    width_m: Float64  # (P,)
    road_m: Float64  # (P,) station of the point along its road's reference line (OpenDRIVE's s)
    change: Int8  # (P,) bit 1: a change to the left is allowed here, bit 2: to the right
    # spatial index: points sorted by grid cell; cell (i, j) holds
    # cell_point[cell_start[j * columns + i] : cell_start[j * columns + i + 1]]
    point_lane: Int32  # (P,) the lane that a point belongs to
    grid_origin: Float64  # (2,) x, y of the grid's corner
    grid_size: Int32  # (2,) columns, rows
    cell_m: Float64  # (1,) side of a cell
    cell_start: Int32  # (columns * rows + 1,)
    cell_point: Int32  # (P,)


class SignalKind(IntEnum):
    """What a signal head is."""

    LIGHT = 1
    STOP = 2
    YIELD = 3


class LightState(IntEnum):
    """What a light shows; NONE where there is no light."""

    NONE = 0
    GREEN = 1
    YELLOW = 2
    RED = 3


@by_reference
class Signals(NamedTuple):
    """Signal heads (S, one an arm of a junction) and the stop lines that they control (K)."""

    kind: Int8  # (S,) SignalKind
    junction: Int32  # (S,) index into Town.junction_names
    group: (
        Int32  # (S,) turn of a light within its junction: groups 0, 1, … take turns; -1 for signs
    )
    pose: Float64  # (S, 4) x, y, z, yaw of the pole's foot; yaw is that of the traffic it faces
    box: Float64  # (S, 6) trigger box: centre x, y, z, yaw, half length (along yaw), half width
    stop_signal: Int32  # (K,) signal of a stop line
    stop_lane: Int32  # (K,) the approach lane; its end is the stop line
    stop_pose: Float64  # (K, 4) x, y, z, yaw of the stop line's middle
    stop_width_m: Float64  # (K,) lane width there
    groups: Int32  # (J,) number of light groups of each junction, 0 where it has no lights


@by_reference
class Crosswalks(NamedTuple):
    """Crosswalks (X): a strip from a kerb to the other, and the driving lanes below it (Y)."""

    start: Float64  # (X, 3) middle of one end
    end: Float64  # (X, 3) middle of the other end
    width_m: Float64  # (X,)
    crossed_start: Int32  # (X + 1,)
    crossed_lane: Int32  # (Y,) driving lanes that the strip lies on
    crossed_begin_m: Float64  # (Y,) lane stations between which it does
    crossed_end_m: Float64  # (Y,)
