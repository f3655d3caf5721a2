"""How far places are from the driving lanes, which is what keeps walkers out of the traffic."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import LaneKind, Lanes

FAR_M = 10.0  # as far as is looked
LEVEL_M = 3.0
DRIVING = int(LaneKind.DRIVING)


@kernel
def _measure(lanes: Lanes, places: Float64, out: Float64) -> None:
    """Fills out (N,) with the clearances [m] of places (N, 3)."""
    for k in range(places.shape[0]):
        out[k] = _clearance(lanes, places[k, 0], places[k, 1], places[k, 2])


@kernel
def _clearance(lanes: Lanes, x: float, y: float, z: float) -> float:
    """Distance [m] of one place from the nearest driving lane's edge, negative on a lane."""
    columns, rows, cell = lanes.grid_size[0], lanes.grid_size[1], lanes.cell_m[0]
    reach = int(FAR_M / cell) + 1
    column = int(np.floor((x - lanes.grid_origin[0]) / cell))
    row = int(np.floor((y - lanes.grid_origin[1]) / cell))
    low, high = max(column - reach, 0), min(column + reach + 1, columns)
    least = FAR_M
    if low >= high:  # beside the grid
        return least
    for j in range(max(row - reach, 0), min(row + reach + 1, rows)):
        at = j * columns
        for c in range(lanes.cell_start[at + low], lanes.cell_start[at + high]):
            point = lanes.cell_point[c]
            if lanes.kind[lanes.point_lane[point]] != DRIVING:
                continue
            if abs(lanes.points[point, 2] - z) >= LEVEL_M:
                continue
            dx, dy = lanes.points[point, 0] - x, lanes.points[point, 1] - y
            distance = np.sqrt(dx * dx + dy * dy) - 0.5 * lanes.width_m[point]
            least = min(least, distance)
    return least


def clearances(lanes: Lanes, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance [m] of each of (N, 3) world places from the nearest driving lane's edge.

    Negative on a lane; 10 at most. Lanes at another level do not count.
    """
    out = np.empty(len(places))
    _measure(lanes, np.ascontiguousarray(places, dtype=np.float64), out)
    return out
