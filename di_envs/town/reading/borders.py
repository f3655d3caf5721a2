"""Widths of lanes that a file gives by their outer borders.

A `<width>` says how wide a lane is, a `<border>` how far its outer edge lies from the reference
line. All are piecewise cubics of the station, as rows (station, a, b, c, d), so a width is the
difference of two borders and a border the sum of the widths within it.
"""

from __future__ import annotations

import numpy as np

from di_envs.numerics.arrays import Float64

NOTHING: Float64 = np.zeros((1, 5))


def summed(first: Float64, second: Float64, sign: float = 1.0) -> Float64:
    """The piecewise cubic `first` + `sign` * `second`, each (n, 5), with the pieces of both."""
    begins = np.unique(np.concatenate([first[:, 0], second[:, 0]]))
    total = _begun_at(first, begins) + sign * _begun_at(second, begins)
    return np.column_stack([begins, total])


def _begun_at(table: Float64, begins: Float64) -> Float64:
    """(m, 4) coefficients a, b, c, d of a piecewise cubic as seen from these stations.

    Before its first station a table goes on as its first piece.
    """
    piece = np.maximum(np.searchsorted(table[:, 0], begins, side="right") - 1, 0)
    start, a, b, c, d = table[piece].T
    h = begins - start
    return np.column_stack(
        [a + h * (b + h * (c + h * d)), b + h * (2.0 * c + 3.0 * h * d), c + 3.0 * h * d, d]
    )
