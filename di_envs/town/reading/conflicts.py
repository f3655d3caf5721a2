"""Where the lanes of a junction come so close that two vehicles cannot pass at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from di_envs.numerics.arrays import Float64, Int32
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import LaneKind, Lanes

CONFLICT_M = 3.0  # between lane centres
LEVEL_M = 2.5  # lanes further apart in height pass above each other


def find_conflicts(lanes: Lanes) -> dict[str, Any]:
    """The `conflict_*` arrays: each place from both lanes' side.

    Lanes of one road run beside each other and do not conflict, however narrow they are. Two lanes
    out of one approach share their start, two into one exit their end: both are conflicts too.
    """
    driving = (lanes.kind == LaneKind.DRIVING) & (lanes.junction >= 0)
    members = np.flatnonzero(driving).astype(np.int32)
    members = members[np.argsort(lanes.junction[members], kind="stable")]
    rows = _conflict_rows(
        members, lanes.junction, lanes.road, lanes.first, lanes.count, lanes.spacing_m, lanes.points
    )
    rows = rows[np.lexsort((rows[:, 2], rows[:, 1], rows[:, 0]))]
    counts = np.bincount(rows[:, 0].astype(np.int64), minlength=len(lanes.kind))
    columns = np.ascontiguousarray(rows.T)
    return {
        "conflict_start": np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        "conflict_lane": columns[1].astype(np.int32),
        "conflict_begin_m": columns[2].copy(),
        "conflict_end_m": columns[3].copy(),
        "conflict_other_begin_m": columns[4].copy(),
        "conflict_other_end_m": columns[5].copy(),
    }


@kernel
def _conflict_rows(
    members: Int32,
    junction: Int32,
    road: Int32,
    first: Int32,
    count: Int32,
    spacing: Float64,
    points: Float64,
) -> Float64:
    """All places where two lanes come close, each from both sides.

    Args:
        members: (M,) driving lanes in junctions, those of a junction in a row.
        junction, road, first, count, spacing: (L,) as of `Lanes`.
        points: (P, 4) as of `Lanes`.

    Returns:
        (C, 6): lane, other lane, its begin and end, the other's begin and end [m].
    """
    rows = np.empty((256, 6))
    found = 0
    for a_index in range(len(members)):
        a = members[a_index]
        for b_index in range(len(members)):
            b = members[b_index]
            if a == b or junction[a] != junction[b] or road[a] == road[b]:
                continue
            k = 0
            while k < count[a]:
                begin, end, low, high = _next_interval(a, b, k, first, count, spacing, points)
                if begin < 0:
                    break
                if found == len(rows):
                    rows = _grown(rows)
                rows[found, 0], rows[found, 1] = a, b
                rows[found, 2], rows[found, 3] = _around(begin, end, count[a], spacing[a])
                rows[found, 4], rows[found, 5] = _around(low, high, count[b], spacing[b])
                found += 1
                k = end + 1
    return rows[:found]


@kernel
def _grown(rows: Float64) -> Float64:
    """Room for twice as many; element by element, as Numba takes seconds to compile a copy."""
    grown = np.empty((2 * rows.shape[0], rows.shape[1]))
    for row in range(rows.shape[0]):
        for column in range(rows.shape[1]):
            grown[row, column] = rows[row, column]
    return grown


@kernel
def _next_interval(
    a: int, b: int, k: int, first: Int32, count: Int32, spacing: Float64, points: Float64
) -> tuple[int, int, int, int]:
    """The next run of a's points from k on that b comes close to, and b's points that do.

    Args:
        a, b: Two lanes.
        k: A point of a, counted along it.
        first, count, spacing: (L,) as of `Lanes`.
        points: (P, 4) as of `Lanes`.

    Returns:
        First and last point of a, least and greatest point of b; -1 where there is no more.
    """
    begin, end, low, high = -1, -1, -1, -1
    while k < count[a]:
        b_low, b_high, skip = _near(first[a] + k, first[b], count[b], spacing[a], points)
        if b_low >= 0:
            if begin < 0:
                begin, low, high = k, b_low, b_high
            end, low, high = k, min(low, b_low), max(high, b_high)
            k += 1
        elif begin >= 0:
            break
        else:
            k += skip
    return begin, end, low, high


@kernel
def _near(
    point: int, b_first: int, b_count: int, step: float, points: Float64
) -> tuple[int, int, int]:
    """Which points of a lane are within reach of a point of another.

    Args:
        point: The point, an index into `points`.
        b_first, b_count: The lane's first point and how many it has.
        step: Between points of the lane that `point` is on [m].
        points: (P, 4) x, y, z, yaw.

    Returns:
        The least and greatest of them (-1 for none), and how many points on may be skipped.
    """
    x, y, z = points[point, 0], points[point, 1], points[point, 2]
    low, high, nearest = -1, -1, 1e18
    for k in range(b_count):
        dx, dy = points[b_first + k, 0] - x, points[b_first + k, 1] - y
        d2 = dx * dx + dy * dy
        if d2 < nearest:
            nearest = d2
        if d2 < CONFLICT_M * CONFLICT_M and abs(points[b_first + k, 2] - z) < LEVEL_M:
            if low < 0:
                low = k
            high = k
    # Nothing of b can come within reach before the distance has been driven.
    skip = max(1, int((np.sqrt(nearest) - CONFLICT_M) / max(step, 1e-3)))
    return low, high, skip


@kernel
def _around(begin: int, end: int, count: int, spacing: float) -> tuple[float, float]:
    """Stations half a point around a run of points, within the lane [m]."""
    length = (count - 1) * spacing
    return max(0.0, (begin - 0.5) * spacing), min(length, (end + 0.5) * spacing)
