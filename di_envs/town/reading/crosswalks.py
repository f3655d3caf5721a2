"""Crosswalks: outlines in an OpenDRIVE file as strips from a kerb to the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.arrays import Float64
from di_envs.town.lanes import Crosswalks, LaneKind, Lanes
from di_envs.town.reading.records import CrosswalkRecord, OpenDrive
from di_envs.town.reading.sampling import LaneGeometry

LEVEL_M = 2.5  # lanes further above or below are not crossed


def find_crosswalks(document: OpenDrive, lanes: Lanes, geometry: LaneGeometry) -> Crosswalks:
    """All crosswalks, and the driving lanes that they lie on."""
    strips = [
        strip_of(outline(record, index, geometry))
        for index, road in enumerate(document.roads)
        for record in road.crosswalks
        if len(record.corners) >= 3
    ]
    crossed = [_crossed(lanes, start, end, width) for start, end, width in strips]
    rows = [row for own in crossed for row in own]
    return Crosswalks(
        start=np.array([strip[0] for strip in strips]).reshape(-1, 3),
        end=np.array([strip[1] for strip in strips]).reshape(-1, 3),
        width_m=np.array([strip[2] for strip in strips], dtype=np.float64),
        crossed_start=np.cumsum([0, *(len(own) for own in crossed)]).astype(np.int32),
        crossed_lane=np.array([row[0] for row in rows], dtype=np.int32),
        crossed_begin_m=np.array([row[1] for row in rows], dtype=np.float64),
        crossed_end_m=np.array([row[2] for row in rows], dtype=np.float64),
    )


def outline(record: CrosswalkRecord, road: int, geometry: LaneGeometry) -> Float64:
    """(n, 3) corners in the world frame, the last not repeating the first."""
    if record.on_road:
        station, t, up = record.corners.T
        x, y, z, heading = geometry.road_pose(np.full(len(t), road), station)
        corners = np.stack([x - np.sin(heading) * t, -(y + np.cos(heading) * t), z + up], axis=1)
    else:
        pose = geometry.road_pose(np.array([road]), np.array([record.s]))
        x, y, z, heading = (value[0] for value in pose)
        x, y = x - np.sin(heading) * record.t, y + np.cos(heading) * record.t
        c, s = np.cos(heading + record.heading), np.sin(heading + record.heading)
        u, v, up = record.corners.T
        corners = np.stack(
            [x + c * u - s * v, -(y + s * u + c * v), z + record.z_offset + up], axis=1
        )
    closed = len(corners) > 3 and np.hypot(*(corners[0] - corners[-1])[:2]) < 1e-3
    return corners[:-1] if closed else corners


def strip_of(corners: Float64) -> tuple[Float64, Float64, float]:
    """The strip of an outline: middles of its two ends and its width [m].

    Of four corners the shorter pair of opposite sides are the ends; other outlines are taken along
    their principal axis.
    """
    if len(corners) == 4:
        sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        k = 0 if sides[0] + sides[2] <= sides[1] + sides[3] else 1
        start = 0.5 * (corners[k] + corners[k + 1])
        end = 0.5 * (corners[k + 2] + corners[(k + 3) % 4])
    else:
        middle = corners.mean(axis=0)
        axis = np.linalg.svd((corners - middle)[:, :2], full_matrices=False)[2][0]
        along = (corners - middle)[:, :2] @ axis
        start, end = middle.copy(), middle.copy()
        start[:2] += along.min() * axis
        end[:2] += along.max() * axis
    x, y = corners[:, 0], corners[:, 1]
    area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    length = max(float(np.hypot(*(end - start)[:2])), 1e-6)
    return start, end, area / length


def _crossed(
    lanes: Lanes, start: Float64, end: Float64, width_m: float
) -> list[tuple[int, float, float]]:
    """(lane, from station, to station) of driving lanes whose centre lies on a strip."""
    along = (end - start)[:2]
    length = max(float(np.hypot(*along)), 1e-6)
    along = along / length
    middle, reach = 0.5 * (start + end), 0.5 * (length + width_m)
    near = np.flatnonzero(np.abs(lanes.points[:, 0] - middle[0]) <= reach)
    offset = lanes.points[near, :3] - middle
    forth = offset[:, :2] @ along
    aside = offset[:, 1] * along[0] - offset[:, 0] * along[1]
    on = (np.abs(forth) <= 0.5 * length) & (np.abs(aside) <= 0.5 * width_m)
    on &= (np.abs(offset[:, 2]) <= LEVEL_M) & (
        lanes.kind[lanes.point_lane[near]] == LaneKind.DRIVING
    )
    found = []
    for points in _runs(near[on], lanes.point_lane):
        lane = int(lanes.point_lane[points[0]])
        spacing, first = float(lanes.spacing_m[lane]), int(lanes.first[lane])
        begin = max(0.0, (points[0] - first - 0.5) * spacing)
        until = min(float(lanes.length_m[lane]), (points[-1] - first + 0.5) * spacing)
        found.append((lane, begin, until))
    return found


def _runs(points: NDArray[np.int64], lane: NDArray[np.int32]) -> list[NDArray[np.int64]]:
    """Consecutive points of the same lane."""
    if not len(points):
        return []
    cut = (np.diff(points) > 1) | (np.diff(lane[points]) != 0)
    return list(np.split(points, np.flatnonzero(cut) + 1))
