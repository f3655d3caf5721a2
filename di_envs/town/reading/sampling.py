"""Samples every lane at even spacing, in the world frame: the points of the network.

All lanes of a town are evaluated together, so that a town takes a few dozen NumPy calls. OpenDRIVE
is right-handed: y and yaw are flipped here, and nowhere else.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Bool, Float64, Int64
from di_envs.town.reading.records import LaneRecord, OpenDrive
from di_envs.town.reading.reference_line import Breakpoints, Cubics, ReferenceLines
from di_envs.town.reading.stretches import Record, Stretch

SPACING = 0.5  # m, the greatest between two points of a lane
MOST_LANE_M = 5e6  # of all lanes together: ten million points
# A lane round a corner may be longer than its reference line, but not by any factor.
LONGER_THAN_ROAD, LONGER_M = 20.0, 500.0
MINIMUM_LANE_LENGTH = 1e-3  # m; keeps spacings positive where a section has no length


class Samples(NamedTuple):
    """Arrays over L lanes and P points, lane after lane in their direction of travel."""

    counts: Int64  # (L,)
    length: Float64  # (L,) m
    points: Float64  # (P, 4) x, y, z, yaw: world frame
    width: Float64  # (P,) m
    station: Float64  # (P,) along the road's reference line
    outward: Bool  # (P,) the mark lets one cross away from the road's centre line
    inward: Bool  # (P,) or towards it
    record: Int64  # (P,) index into LaneGeometry.records


class LaneGeometry:
    """Where every lane of every section lies, as functions of its road's stations."""

    def __init__(self, document: OpenDrive, stretches: list[Stretch]) -> None:
        self.records: dict[Record, int] = {}
        lanes: list[LaneRecord] = []
        for road_index, road in enumerate(document.roads):
            for number, section in enumerate(road.sections):
                for lane_id, lane in section.lanes.items():
                    self.records[road_index, number, lane_id] = len(lanes)
                    lanes.append(lane)
        self.lanes = lanes
        self.roads = document.roads
        self._lane_ids = np.array([lane.lane_id for lane in lanes])
        self._road = np.array([s.road for s in stretches])
        self._side = np.sign([s.lane_id for s in stretches])
        self._forward = np.array([s.forward for s in stretches])
        self._line = ReferenceLines([road.geometry for road in document.roads])
        self._elevation = Cubics([road.elevation for road in document.roads])
        self._offset = Cubics([road.lane_offset for road in document.roads])
        self._bank = Cubics([road.superelevation for road in document.roads])
        self._falls = [Cubics([road.crossfall[k] for road in document.roads]) for k in (0, 1)]
        self._banked = any(
            table[:, 1:].any()
            for road in document.roads
            for table in (road.superelevation, *road.crossfall)
        )
        self._width = Cubics([lane.widths for lane in lanes])
        self._find_records(document, stretches)
        self._find_marks()

    def _find_records(self, document: OpenDrive, stretches: list[Stretch]) -> None:
        begins, pieces = [], []
        for stretch in stretches:
            sections = document.roads[stretch.road].sections
            begins.append(np.array([sections[number].begin for _, number, _ in stretch.records]))
            pieces += [self.records[record] for record in stretch.records]
        self._sections = Breakpoints(begins)
        self._piece_record = np.array(pieces)
        keys = list(self.records)
        depth = max((abs(lane_id) for _, _, lane_id in keys), default=0)
        self._inner = np.full((len(keys), max(depth, 1)), -1)  # lanes between it and the centre
        for row, (road, number, lane_id) in enumerate(keys):
            side = 1 if lane_id > 0 else -1
            for k in range(abs(lane_id)):
                self._inner[row, k] = self.records.get((road, number, side * k), -1)

    def _find_marks(self) -> None:
        tables = [lane.marks or ((0.0, False, False),) for lane in self.lanes]
        self._marks = Breakpoints([np.array([mark[0] for mark in table]) for table in tables])
        self._crossing = np.array([mark[1:] for table in tables for mark in table])  # up, down

    def out_of_proportion(self, lane: int, why: str) -> ValueError:
        """An error that names the road of a lane, and where the file has it."""
        road = self.roads[int(self._road[lane])]
        return ValueError(
            f"road '{road.road_id}', line {road.line}: {why}; is one of its lengths, widths, "
            "offsets or curves wrong?"
        )

    def road_pose(self, road: Int64, station: Float64) -> tuple[Float64, Float64, Float64, Float64]:
        """(N,) x, y, z, heading of reference lines, in OpenDRIVE's frame."""
        x, y, heading, _ = self._line(road, station)
        return x, y, self._elevation(road, station)[0], heading

    def centre(
        self, lane: Int64, station: Float64
    ) -> tuple[Float64, Float64, Float64, Float64, Float64, Int64]:
        """(N,) x, y, z, heading along growing stations, width, record; OpenDRIVE's frame."""
        road, side = self._road[lane], self._side[lane]
        record = self._piece_record[self._sections.find(lane, station)]
        width, slope = self._width(record, station)
        t, dt = self._offset(road, station)
        t, dt = t + 0.5 * side * width, dt + 0.5 * side * slope
        for k in range(1, self._inner.shape[1]):  # lanes are stacked from the centre outwards
            inner = self._inner[record, k]
            here = np.flatnonzero(inner >= 0)
            if len(here):
                value, grade = self._width(inner[here], station[here])
                t[here] += side[here] * value
                dt[here] += side[here] * grade
        x, y, heading, curvature = self._line(road, station)
        z, _ = self._elevation(road, station)
        if self._banked:
            z, t = self._lifted(road, station, z, t)
        # Inside of a bend tighter than the offset the lane would run backwards: keep the road's.
        ahead = np.maximum(1.0 - curvature * t, 1e-6)
        x, y = x - np.sin(heading) * t, y + np.cos(heading) * t
        return x, y, z, heading + np.arctan2(dt, ahead), width, record

    def _lifted(
        self, road: Int64, station: Float64, z: Float64, t: Float64
    ) -> tuple[Float64, Float64]:
        """(N,) heights and offsets on banked roads: turned about the reference line, and falling.

        A positive superelevation lifts the left side, a positive crossfall lowers outer edges.
        """
        bank = self._bank(road, station)[0]
        left, right = (fall(road, station)[0] for fall in self._falls)
        fall = np.tan(np.where(t > 0.0, left, right))
        return z + np.sin(bank) * t - fall * np.abs(t), np.cos(bank) * t

    def crossing(self, record: Int64, station: Float64) -> tuple[Bool, Bool]:
        """(N,) whether marks let one cross outwards and inwards of a lane."""
        lane_id = self._lane_ids[record]
        side = lane_id > 0
        inner_record = self._inner[record, np.abs(lane_id) - 1]
        outer = self._crossing[self._marks.find(record, station)]
        inner = self._crossing[self._marks.find(np.maximum(inner_record, 0), station)]
        # Outwards is towards greater ids on the left side, towards smaller ids on the right.
        outward = np.where(side, outer[:, 0], outer[:, 1])
        inward = np.where(side, inner[:, 1], inner[:, 0]) & (inner_record >= 0)
        return outward, inward


def sample_lanes(geometry: LaneGeometry, stretches: list[Stretch]) -> Samples:
    """Even points along all lanes, at most `SPACING` apart."""
    begin = np.array([s.begin for s in stretches])
    end = np.array([s.end for s in stretches])
    forward = np.array([s.forward for s in stretches])
    lane, station = _even_stations(geometry, begin, end, forward)
    count = np.bincount(lane, minlength=len(stretches))
    x, y, z, heading, width, record = geometry.centre(lane, station)
    outward, inward = geometry.crossing(record, station)
    yaw = -heading + np.where(forward[lane], 0.0, np.pi)
    points = np.stack([x, -y, z, _continuous(yaw, lane)], axis=1)
    total = np.bincount(lane[1:], _steps(x, y, lane), minlength=len(stretches))
    length = np.maximum(total, MINIMUM_LANE_LENGTH)
    return Samples(count, length, points, width, station, outward, inward, record)


def _even_stations(
    geometry: LaneGeometry, begin: Float64, end: Float64, forward: Bool
) -> tuple[Int64, Float64]:
    """Stations whose lane-centre points are evenly spaced: first along the road, then along it."""
    _check_lengths(geometry, end - begin, end - begin)
    lane, fraction = _grid(np.maximum(np.ceil((end - begin) / SPACING).astype(int) + 1, 2))
    station = begin[lane] + fraction * (end - begin)[lane]
    x, y = geometry.centre(lane, station)[:2]
    # All lanes on one axis of arc length, a metre between two of them.
    new_lane = np.diff(lane) != 0
    arc = np.concatenate([[0.0], np.cumsum(_steps(x, y, lane) + new_lane)])
    starts = np.searchsorted(lane, np.arange(len(begin)))
    ends = np.append(starts[1:], len(lane)) - 1
    length = arc[ends] - arc[starts]
    _check_lengths(geometry, length, end - begin)
    lane, fraction = _grid(np.maximum(np.ceil(length / SPACING - 1e-9).astype(int) + 1, 2))
    fraction = np.where(forward[lane], fraction, 1.0 - fraction)
    even = np.interp(arc[starts[lane]] + fraction * length[lane], arc, station)
    return lane, np.clip(even, begin[lane], end[lane])


def _check_lengths(geometry: LaneGeometry, length: Float64, along: Float64) -> None:
    """Refuses lanes that no road has, before they ask for memory.

    Args:
        geometry: The lanes.
        length: (L,) lengths [m].
        along: (L,) those of their stretches of reference line.

    Raises:
        ValueError: With the road whose lane is the longest.
    """
    known = np.where(np.isfinite(length), length, np.inf)
    longer = known > LONGER_THAN_ROAD * along + LONGER_M
    if longer.any() or known.sum() > MOST_LANE_M:
        worst = int(np.argmax(np.where(longer, known, 0.0) if longer.any() else known))
        raise geometry.out_of_proportion(
            worst,
            f"a lane of it would measure {length[worst]:g} m over {along[worst]:g} m of road, all "
            f"lanes together {known.sum():g} m (of {MOST_LANE_M:g} m at most)",
        )


def _grid(count: Int64) -> tuple[Int64, Float64]:
    """`count` fractions from 0 to 1 for each lane: the lane of each, and the fraction."""
    lane = np.repeat(np.arange(len(count)), count)
    first = np.cumsum(count) - count
    return lane, (np.arange(len(lane)) - first[lane]) / (count - 1)[lane]


def _steps(x: Float64, y: Float64, lane: Int64) -> Float64:
    """(P - 1,) distances between neighbouring points, 0 from one lane to the next."""
    steps: Float64 = np.hypot(np.diff(x), np.diff(y)) * (np.diff(lane) == 0)
    return steps


def _continuous(yaw: Float64, lane: Int64) -> Float64:
    """Adds whole turns so that yaw has no jump along a lane and begins in [-pi, pi)."""
    first = np.searchsorted(lane, lane)  # each point's lane's first point
    jumps = np.round(np.diff(yaw) / (2.0 * np.pi)) * (np.diff(lane) == 0)
    turns = np.concatenate([[0.0], np.cumsum(jumps)])
    turns = turns - turns[first] + np.floor((yaw[first] + np.pi) / (2.0 * np.pi))
    continuous: Float64 = yaw - 2.0 * np.pi * turns
    return continuous
