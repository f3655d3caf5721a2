"""Builds the lane network of a town from its OpenDRIVE records."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.arrays import Bool, Float64, Int8, Int32, Int64
from di_envs.town.lanes import LaneKind, Lanes, Turn
from di_envs.town.reading.conflicts import find_conflicts
from di_envs.town.reading.links import as_ranges, find_successors, reversed_links
from di_envs.town.reading.records import OpenDrive
from di_envs.town.reading.sampling import (
    MINIMUM_LANE_LENGTH,
    LaneGeometry,
    Samples,
    sample_lanes,
)
from di_envs.town.reading.stretches import Stretch, find_stretches

DEFAULT_SPEED_MPS = 50.0 / 3.6  # where neither a lane, its road nor a neighbour along it says
STRAIGHT_BELOW_RAD = np.deg2rad(35.0)  # CARLA's planner calls smaller changes of heading straight
CELL_M = 4.0  # of the spatial index
MOST_CELLS, HIGHEST_M = 25_000_000, 10_000.0  # of a town: 20 km by 20 km, and of mountains
CHANGE_LEFT, CHANGE_RIGHT = 1, 2  # bits of Lanes.change


def build_lanes(document: OpenDrive, source: str) -> tuple[Lanes, LaneGeometry, list[Stretch]]:
    """The network, and what signals and crosswalks need to be placed on it.

    Args:
        document: What the file says.
        source: What to call the file in errors.

    Raises:
        ValueError: If there is no lane to drive on, or lanes are out of all proportion.
    """
    stretches = find_stretches(document)
    if not any(s.kind == LaneKind.DRIVING for s in stretches):
        raise ValueError(
            f"{source} has no driving lanes ({len(document.roads)} roads, {len(stretches)} lanes "
            "of other kinds); a town needs lanes of type 'driving'."
        )
    geometry = LaneGeometry(document, stretches)
    try:
        samples = sample_lanes(geometry, stretches)
        _check_places(geometry, samples)
    except ValueError as error:
        raise ValueError(f"{source}: not readable as OpenDRIVE: {error}") from error
    successors = find_successors(document, stretches)
    return _assemble(document, stretches, geometry, samples, successors), geometry, stretches


def _check_places(geometry: LaneGeometry, samples: Samples) -> None:
    """Refuses a map that spreads over more ground than towns do: its grid would fill memory.

    Raises:
        ValueError: With the road that lies farthest from the middle of the others.
    """
    places = samples.points[:, :3]
    finite: Bool = np.all(np.isfinite(samples.points), axis=1)
    middle = np.median(places[finite], axis=0) if finite.any() else np.zeros(3)
    away = np.where(finite[:, None], np.abs(places - middle), np.inf)
    far = int(np.argmax(away.max(axis=1)))
    spread = (places.max(axis=0) - places.min(axis=0)) / CELL_M
    fits = finite.all() and max(spread[0], 1.0) * max(spread[1], 1.0) <= MOST_CELLS
    if not (fits and spread[2] <= HIGHEST_M / CELL_M):
        lane = int(np.searchsorted(np.cumsum(samples.counts), far, side="right"))
        raise geometry.out_of_proportion(
            lane,
            f"it lies {np.hypot(*away[far, :2]):g} m aside of the middle of the map and "
            f"{away[far, 2]:g} m above or below it, which no town holds",
        )


def _assemble(
    document: OpenDrive,
    stretches: list[Stretch],
    geometry: LaneGeometry,
    samples: Samples,
    successors: list[set[int]],
) -> Lanes:
    first = np.cumsum(samples.counts) - samples.counts
    junction = _junctions(document, stretches)
    predecessors = reversed_links(successors)
    left, right = _neighbours(document, stretches)
    lane = np.repeat(np.arange(len(stretches)), samples.counts)
    lanes = Lanes(
        kind=np.array([s.kind for s in stretches], dtype=np.int8),
        road=np.array([s.road for s in stretches], dtype=np.int32),
        section=np.array([s.section for s in stretches], dtype=np.int32),
        lane_id=np.array([s.lane_id for s in stretches], dtype=np.int32),
        junction=junction,
        turn=_turns(stretches, junction, samples, first),
        length_m=samples.length,
        spacing_m=samples.length / (samples.counts - 1),
        longest_step_m=_longest_steps(samples.points, lane, len(stretches)),
        speed_limit_mps=_speed_limits(document, stretches, geometry, successors, predecessors),
        first=first.astype(np.int32),
        count=samples.counts.astype(np.int32),
        left=left,
        right=right,
        stop_line=np.full(len(stretches), -1, dtype=np.int32),
        successor_start=as_ranges(successors)[0],
        successor=as_ranges(successors)[1],
        predecessor_start=as_ranges(predecessors)[0],
        predecessor=as_ranges(predecessors)[1],
        **_no_conflicts(len(stretches)),
        points=samples.points,
        width_m=np.maximum(samples.width, 0.0),
        road_m=samples.station,
        change=_changes(document, stretches, samples, lane, left, right),
        point_lane=lane.astype(np.int32),
        **_spatial_index(samples.points),
    )
    return lanes._replace(**find_conflicts(lanes))


def _longest_steps(points: Float64, lane: Int64, lanes: int) -> Float64:
    """(L,) the greatest distance [m] between two neighbours among a lane's points, above 0."""
    steps = np.hypot(*np.diff(points[:, :2], axis=0).T)
    same = np.diff(lane) == 0
    longest = np.full(lanes, MINIMUM_LANE_LENGTH)
    np.maximum.at(longest, lane[1:][same], steps[same])
    return longest


def _no_conflicts(count: int) -> dict[str, Any]:
    empty: dict[str, Any] = {
        "conflict_start": np.zeros(count + 1, dtype=np.int32),
        "conflict_lane": np.zeros(0, dtype=np.int32),
    }
    for name in ("begin_m", "end_m", "other_begin_m", "other_end_m"):
        empty[f"conflict_{name}"] = np.zeros(0)
    return empty


def _junctions(document: OpenDrive, stretches: list[Stretch]) -> Int32:
    index = {name: i for i, name in enumerate(junction_names(document))}
    per_road = [index.get(road.junction or "", -1) for road in document.roads]
    return np.array([per_road[s.road] for s in stretches], dtype=np.int32)


def junction_names(document: OpenDrive) -> tuple[str, ...]:
    """The junctions that roads lie in, in the order of the file."""
    used = {road.junction for road in document.roads if road.junction is not None}
    listed = [name for name in document.junctions if name in used]
    return (*listed, *sorted(used - set(listed)))


def _turns(
    stretches: list[Stretch], junction: Int32, samples: Samples, first: NDArray[np.int64]
) -> Int8:
    yaw = samples.points[:, 3]
    change = yaw[first + samples.counts - 1] - yaw[first]
    turn = np.where(change < 0.0, Turn.LEFT, Turn.RIGHT)
    turn = np.where(np.abs(change) < STRAIGHT_BELOW_RAD, Turn.STRAIGHT, turn)
    driving = np.array([s.kind == LaneKind.DRIVING for s in stretches])
    return np.where(driving & (junction >= 0), turn, Turn.NONE).astype(np.int8)


def _neighbours(document: OpenDrive, stretches: list[Stretch]) -> tuple[Int32, Int32]:
    """The driving lanes beside each, in the same direction: those of adjacent ids."""
    left = np.full(len(stretches), -1, dtype=np.int32)
    right = np.full(len(stretches), -1, dtype=np.int32)
    groups: dict[tuple[int, int, bool], list[int]] = {}
    for index, stretch in enumerate(stretches):
        if stretch.kind == LaneKind.DRIVING:
            key = (stretch.road, stretch.group, stretch.lane_id > 0)
            groups.setdefault(key, []).append(index)
    for members in groups.values():
        for low, high in pairwise(members):  # ascending lane ids
            if _beside(document, stretches[low], stretches[high]):
                # Ids grow to the left of the road's direction.
                a, b = (low, high) if stretches[low].forward else (high, low)
                left[a], right[b] = b, a
    return left, right


def _beside(document: OpenDrive, low: Stretch, high: Stretch) -> bool:
    """Whether two lanes have adjacent ids along most of their way."""
    sections = document.roads[low.road].sections
    touching = sum(
        sections[low.section + i].end - sections[low.section + i].begin
        for i, (a, b) in enumerate(zip(low.lane_ids, high.lane_ids, strict=True))
        if b - a == 1
    )
    return touching > 0.5 * (low.end - low.begin) or (
        low.end <= low.begin and high.lane_id - low.lane_id == 1
    )


def _changes(
    document: OpenDrive,
    stretches: list[Stretch],
    samples: Samples,
    lane: NDArray[np.int64],
    left: Int32,
    right: Int32,
) -> Int8:
    """The marks' word, where there is a lane to change to."""
    right_hand = np.array([document.roads[s.road].right_hand for s in stretches])[lane]
    to_right = np.where(right_hand, samples.outward, samples.inward) & (right[lane] >= 0)
    to_left = np.where(right_hand, samples.inward, samples.outward) & (left[lane] >= 0)
    return (CHANGE_LEFT * to_left + CHANGE_RIGHT * to_right).astype(np.int8)


def _speed_limits(
    document: OpenDrive,
    stretches: list[Stretch],
    geometry: LaneGeometry,
    successors: list[set[int]],
    predecessors: list[set[int]],
) -> Float64:
    """Each lane's own limit, or its road's, or that of the lanes before it, or after it."""
    limit = np.array([_own_limit(document, s, geometry) for s in stretches])
    for neighbours in (predecessors, successors):
        waiting = [i for i in np.flatnonzero(np.isnan(limit)) if neighbours[i]]
        while waiting:
            known = {i: limit[sorted(neighbours[i])] for i in waiting}
            solved = {i: v[~np.isnan(v)].min() for i, v in known.items() if (v == v).any()}
            if not solved:
                break
            limit[list(solved)] = list(solved.values())
            waiting = [i for i in waiting if i not in solved]
    return np.where(np.isnan(limit), DEFAULT_SPEED_MPS, limit)


def _own_limit(document: OpenDrive, stretch: Stretch, geometry: LaneGeometry) -> float:
    middle = 0.5 * (stretch.begin + stretch.end)
    sections = document.roads[stretch.road].sections
    for record in stretch.records:
        if sections[record[1]].begin <= middle <= sections[record[1]].end:
            for station, speed in reversed(geometry.lanes[geometry.records[record]].speeds):
                if station <= middle:
                    return speed
    for station, speed in reversed(document.roads[stretch.road].speeds):
        if station <= middle:
            return speed
    return float("nan")


def _spatial_index(points: Float64) -> dict[str, Any]:
    origin = np.floor(points[:, :2].min(axis=0) / CELL_M) * CELL_M
    cell = np.floor((points[:, :2] - origin) / CELL_M).astype(np.int64)
    size = cell.max(axis=0) + 1
    flat = cell[:, 1] * size[0] + cell[:, 0]
    start = np.concatenate([[0], np.cumsum(np.bincount(flat, minlength=int(size.prod())))])
    return {
        "grid_origin": origin,
        "grid_size": size.astype(np.int32),
        "cell_m": np.array([CELL_M]),
        "cell_start": start.astype(np.int32),
        "cell_point": np.argsort(flat, kind="stable").astype(np.int32),
    }
