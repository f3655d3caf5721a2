"""Asking for memory beforehand changes nothing."""

from __future__ import annotations

import numba
import numpy as np

from di_envs.numerics.prefetching import prefetch


# not cached on disk: its source is this file
@numba.njit(nogil=True)
def sum_of(table, rows):
    total = 0.0
    for index in range(rows.size):
        prefetch(table, rows[min(index + 1, rows.size - 1)])
        total += table[rows[index]].sum()
    return total


def test_a_kernel_that_asks_for_rows_reads_what_is_there():
    table = np.arange(12.0).reshape(4, 3)
    kept = table.copy()
    assert sum_of(table, np.array([3, 0, 2], np.int32)) == (9 + 10 + 11) + (0 + 1 + 2) + (6 + 7 + 8)
    assert sum_of(table[::-1], np.array([0])) == 9 + 10 + 11
    np.testing.assert_array_equal(table, kept)


def test_python_may_call_it_too():
    assert prefetch(np.zeros(3), 1) is None
