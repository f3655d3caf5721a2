"""The rows in which kernels report events, so that a tick allocates nothing."""

from __future__ import annotations

from di_envs.numerics.arrays import Float64, Int32
from di_envs.numerics.kernels import kernel

# kind, ego, tick, x, y, z, other, value: the fields of `Event`
COLUMNS = 8
# at most this many rows an ego and tick: one collision, bodies hit for the first time, one stop
# sign, a red light or two by each line, the metres outside lanes, too low a speed, the end of the
# route, a scenario
ROWS_PER_EGO = 16


@kernel
def record(
    out: Float64,
    n: int,
    kind: int,
    ego: int,
    tick: int,
    x: float,
    y: float,
    z: float,
    other: int,
    value: float,
) -> int:
    """Writes row `n` of `out` (N, COLUMNS) and returns `n + 1`; x, y, z are in the world frame [m].

    Raises:
        ValueError: If `out` has no row left: it needs ROWS_PER_EGO for each ego and tick.
    """
    if n >= out.shape[0]:
        raise ValueError("The event rows are full: give ROWS_PER_EGO rows for each ego and tick.")
    out[n, 0] = kind
    out[n, 1] = ego
    out[n, 2] = tick
    out[n, 3] = x
    out[n, 4] = y
    out[n, 5] = z
    out[n, 6] = other
    out[n, 7] = value
    return n + 1


@kernel
def count_rows(counts: Int32, out: Float64, begin: int, end: int) -> None:
    """Adds the rows [begin, end) of `out` to the egos' `counts` (E, EVENT_KINDS)."""
    for k in range(begin, end):
        counts[int(out[k, 1]), int(out[k, 0])] += 1
