"""Where CARLA puts a place on a lane, to the last bit of the single precision that it keeps.

CARLA's planner asks whether a point is more than a metre away from an end. On lanes of whole metres
the answer hangs on the last bit of coordinates that CARLA holds in 32 bits, and with it the number
of all points that follow. So its arithmetic is repeated here, operation by operation, for lines and
arcs; other curves do not have whole metres between their points.

Source: behaviour of `LibCarla/source/carla/road` (`Lane::ComputeTransform`, `Road::
GetDirectedPointIn`, `Geometry::PosFromDist`; CARLA 0.9.12 to 0.9.16, Computer Vision Center, MIT
licence); the code here is ours.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import LaneKind
from di_envs.town.reading.opendrive import read_opendrive
from di_envs.town.reading.records import GeometryRecord, RoadRecord, SectionRecord

Single = np.float32
SAME_LANE_M = 0.1  # between our place on a lane and CARLA's
Place = tuple[Any, Any, Any]  # x, y, z as CARLA's `Location` holds them, world frame


class CarlaRoads:
    """Places on the roads of a map, and their slopes, as CARLA works them out."""

    def __init__(self, opendrive: str) -> None:
        roads = read_opendrive(opendrive, "the map").roads if opendrive else ()
        self._roads: Mapping[str, RoadRecord] = {road.road_id: road for road in roads}

    def place(self, road_id: str, station_m: float, near: NDArray[np.float64]) -> Place | None:
        """The centre of a lane.

        Args:
            road_id: The road.
            station_m: Along the road's reference line.
            near: (2 or more,) x, y about there: lanes of a road are numbered anew in each section.

        Returns:
            None on a curve that is neither a line nor an arc, and where no lane is near.
        """
        road = self._roads.get(road_id)
        if road is None:
            return None
        station_m = min(max(station_m, 0.0), road.length)
        section = road.sections[_at([section.begin for section in road.sections], station_m)]
        geometry = road.geometry[_at([piece.begin for piece in road.geometry], station_m)]
        centre = _centre(geometry, station_m)
        if centre is None:
            return None
        x, y, tangent = centre
        offset = Single(-Single(_polynomial(road.lane_offset, station_m)))
        x, y = _aside(x, y, tangent, offset)
        lanes = [
            _aside(x, y, tangent, _lateral(section, lane_id, station_m))
            for lane_id in sorted(section.lanes)
            if section.lanes[lane_id].kind == LaneKind.DRIVING and lane_id
        ]
        found = min(lanes, key=lambda lane: _off_m(lane, near), default=None)
        if found is None or _off_m(found, near) > SAME_LANE_M:
            return None
        return found[0], Single(-found[1]), Single(_polynomial(road.elevation, station_m))

    def slopes(self, road_id: str, station_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,) rise of a road per metre, at (N,) stations; CARLA takes it for the pitch [rad]."""
        road = self._roads.get(road_id)
        if road is None or not len(road.elevation):
            return np.zeros(len(station_m))
        which = np.searchsorted(road.elevation[:, 0], station_m, side="right") - 1
        begin, _, b, c, d = road.elevation[np.maximum(which, 0)].T
        along_m = station_m - begin
        return np.asarray(b + 2.0 * c * along_m + 3.0 * d * along_m * along_m)


def away_m(a: Place, b: Place) -> Any:
    """The distance, as CARLA's `Location::Distance` has it."""
    x, y, z = (Single(p - q) for p, q in zip(a, b, strict=True))
    return Single(np.sqrt(Single(Single(Single(x * x) + Single(y * y)) + Single(z * z))))


def _off_m(lane: tuple[Any, Any], near: NDArray[np.float64]) -> float:
    return math.hypot(float(lane[0]) - near[0], -float(lane[1]) - near[1])


def _at(begins: list[float], station_m: float) -> int:
    return max(bisect.bisect_right(begins, station_m) - 1, 0)


def _centre(geometry: GeometryRecord, station_m: float) -> tuple[Any, Any, float] | None:
    """x, y and direction of the reference line, right-handed."""
    along_m = min(max(station_m - geometry.begin, 0.0), geometry.length)
    x, y, heading = Single(geometry.x), Single(geometry.y), geometry.heading
    if geometry.shape == "line":
        x = Single(x + Single(along_m * math.cos(heading)))
        return x, Single(y + Single(along_m * math.sin(heading))), heading
    if geometry.shape != "arc":
        return None
    curvature = geometry.parameters[0]
    radius, right = 1.0 / curvature, heading + math.pi / 2.0
    x = Single(x + Single(radius * math.cos(right)))
    y = Single(y + Single(radius * math.sin(right)))
    heading += along_m * curvature
    right = heading + math.pi / 2.0
    x = Single(x - Single(radius * math.cos(right)))
    return x, Single(y - Single(radius * math.sin(right))), heading


def _aside(x: Any, y: Any, tangent: float, offset: Any) -> tuple[Any, Any]:
    """A place moved to the right of a direction."""
    direction = Single(tangent)
    right_x, right_y = np.sin(direction), Single(-np.cos(direction))
    return Single(x + Single(offset * right_x)), Single(y + Single(offset * right_y))


def _lateral(section: SectionRecord, lane_id: int, station_m: float) -> Any:
    """How far right of the reference line a lane's centre lies."""
    side = 1 if lane_id > 0 else -1
    offset = Single(0.0)
    for number in range(side, lane_id + side, side):
        lane = section.lanes.get(number)
        if lane is None:
            continue
        width = _polynomial(lane.widths, station_m)
        part = 0.5 * width if number == lane_id else width
        offset = Single(float(offset) - side * part)
    return offset


def _polynomial(records: Any, station_m: float) -> float:
    """The value of the cubic that holds at a station; 0 where there is none."""
    if not len(records):
        return 0.0
    begin, a, b, c, d = records[_at(records[:, 0].tolist(), station_m)].tolist()
    # CARLA multiplies out, so that the station itself can be put in
    square, cube = begin * begin, begin * begin * begin
    value: float = (
        (a - b * begin + c * square - d * cube)
        + (b - 2.0 * c * begin + 3.0 * d * square) * station_m
        + (c - 3.0 * d * begin) * station_m * station_m
        + d * station_m * station_m * station_m
    )
    return value
