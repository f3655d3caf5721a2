"""Kernels that are called by their address."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from di_envs.numerics.machine_code import MachineCode, call


# not cached on disk: their source is this file
@numba.njit(nogil=True, error_model="numpy")
def root_of(values, index):
    if values[index] < 0.0:
        raise ValueError("no root of a negative number")
    values[index] = np.sqrt(values[index])
    return values[index]


@numba.njit(nogil=True, error_model="numpy")
def sum_of_roots(code, values):
    total = 0.0
    for index in range(values.size):
        total += call(code, values, index)
    return total


def test_a_kernel_calls_another_that_changes_what_it_is_given():
    values = np.array([4.0, 9.0])
    code = MachineCode(root_of, values, 0)
    assert sum_of_roots(code, values) == 5.0
    assert values.tolist() == [2.0, 3.0]


def test_what_it_raises_comes_through():
    values = np.array([4.0, -9.0])
    with pytest.raises(ValueError, match="no root of a negative number"):
        sum_of_roots(MachineCode(root_of, values, 0), values)


def test_python_calls_it_likewise():
    values = np.array([16.0])
    assert call(MachineCode(root_of, values, 0), values, 0) == 4.0
