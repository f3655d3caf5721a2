"""Rows of bundles: what a kernel that works on many worlds takes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from di_envs.numerics.bundle_rows import BundleRow
from di_envs.numerics.bundles import by_reference


@by_reference
class Account(NamedTuple):
    """What somebody has, and at what rate it grows."""

    money: Any
    rate: float


# not cached on disk: its source is this file
@numba.njit
def grow(accounts, count):
    total = 0.0
    for index in range(count):
        account = accounts[index]
        account.money[:] += account.money * account.rate
        total += account.money.sum()
    return total


def account(*money, rate=0.5):
    return Account(money=np.array(money), rate=rate)


def test_a_kernel_reads_each_bundle_and_writes_to_its_arrays():
    first, second = account(2.0, 4.0), account(10.0, rate=0.1)
    row = BundleRow([first, second])
    assert grow(row, 2) == 3.0 + 6.0 + 11.0
    assert first.money.tolist() == [3.0, 6.0]
    assert row[1].money.tolist() == [11.0]


def test_a_bundle_can_be_replaced_by_another_of_its_type():
    row = BundleRow([account(2.0), account(4.0)])
    grow(row, 2)
    row[0] = account(100.0, rate=0.0)
    assert grow(row, 1) == 100.0


def test_a_bundle_with_arrays_of_another_type_is_refused():
    other = Account(money=np.array([1], np.int32), rate=0.5)
    with pytest.raises(TypeError, match="of one type"):
        BundleRow([account(2.0), other])
    row = BundleRow([account(2.0)])
    with pytest.raises(TypeError, match="of one type"):
        row[0] = other
