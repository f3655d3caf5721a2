"""Bundles: named tuples of arrays that kernels take as one pointer."""

from __future__ import annotations

import pickle
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from di_envs.numerics.bundles import by_reference
from di_envs.town.loading import load_town
from di_envs.world.state import Capacity, State, state_dtype, views_of


@by_reference
class Inner(NamedTuple):
    """A bundle within another."""

    values: Any
    factor: float


@by_reference
class Outer(NamedTuple):
    """Arrays of several shapes and types, numbers and a bundle."""

    matrix: Any
    index: Any
    scalar: Any
    count: int
    inner: Inner


# not cached on disk: these tests look at what is compiled
@numba.njit
def weighted(bundle, row):
    total = bundle.scalar[()] + bundle.count
    for k in range(bundle.index.size):
        total += bundle.matrix[row, bundle.index[k]] * bundle.inner.factor
    for value in bundle.inner.values:
        total += value
    return total


@numba.njit
def count_up(bundle):
    bundle.matrix[0, 0] += 1.0
    bundle.inner.values[:] = bundle.matrix[0, 0]
    bundle.scalar[()] += 1


@numba.njit
def inner_of(bundle):
    return add_up(bundle.inner)


@numba.njit
def add_up(inner):
    return inner.values.sum() * inner.factor


def make_outer(**changes: Any) -> Outer:
    values = {
        "matrix": np.arange(6.0).reshape(2, 3),
        "index": np.array([0, 2], np.int32),
        "scalar": np.array(10, np.int64),
        "count": 5,
        "inner": Inner(values=np.array([0.5, 0.25]), factor=2.0),
    }
    return Outer(**{**values, **changes})


def test_a_kernel_reads_arrays_numbers_and_inner_bundles():
    # 10 + 5 + (3 + 5) * 2 + 0.5 + 0.25
    assert weighted(make_outer(), 1) == 31.75


def test_an_inner_bundle_is_passed_on_to_another_kernel():
    assert inner_of(make_outer()) == 1.5


def test_what_a_kernel_writes_is_in_the_arrays_of_the_bundle():
    outer = make_outer()
    matrix, values = outer.matrix, outer.inner.values
    for _ in range(3):
        count_up(outer)
    assert (matrix[0, 0], int(outer.scalar), values.tolist()) == (3.0, 13, [3.0, 3.0])


def test_views_with_strides_are_read_where_they_lie():
    wide = np.arange(60.0).reshape(6, 10)
    view = wide[1::3, 2::3]  # every third of rows and columns
    expected = 15 + 2.0 * (view[1, 0] + view[1, 2]) + 0.75
    assert weighted(make_outer(matrix=view), 1) == expected


def test_python_sees_a_named_tuple():
    outer = make_outer()
    assert isinstance(outer, tuple)
    assert outer._fields == ("matrix", "index", "scalar", "count", "inner")
    assert outer[3] == outer.count == 5
    changed = outer._replace(count=6)
    assert isinstance(changed, Outer)
    assert weighted(changed, 1) == weighted(outer, 1) + 1.0  # not the block of the first


def test_a_pickled_bundle_never_carries_an_address():
    outer = make_outer()
    before = weighted(outer, 1)  # makes the blocks
    assert "bundle_address" in vars(outer)
    copy = pickle.loads(pickle.dumps(outer))
    assert vars(copy) == {}
    assert copy.bundle_address != outer.bundle_address
    assert copy.inner.bundle_address != outer.inner.bundle_address
    copy.matrix[:] = 0.0
    assert weighted(copy, 1) == 15.75
    assert weighted(outer, 1) == before


def test_read_only_views_and_other_shapes_compile_nothing_new():
    weighted(make_outer(), 1)
    compiled = len(weighted.signatures)
    frozen = np.arange(6.0).reshape(2, 3)
    frozen.flags.writeable = False
    assert weighted(make_outer(matrix=frozen), 1) == 31.75
    weighted(make_outer(matrix=np.ones((50, 3)), index=np.zeros(7, np.int32)), 1)
    assert len(weighted.signatures) == compiled


def test_bundles_that_are_alike_share_one_type_and_others_have_their_own():
    first, again = make_outer(), make_outer(index=np.zeros(9, np.int32), count=7)
    assert first.bundle_type is again.bundle_type
    assert numba.typeof(first) is first.bundle_type
    turned = np.asfortranarray(np.ones((2, 3)))
    wide = np.ones((4, 6))[::2, ::2]
    packed = np.zeros(2, [("flag", "i1"), ("value", "f8")])["value"]  # not aligned
    changes = ({"matrix": turned}, {"matrix": wide}, {"scalar": np.array(1.0)}, {"count": 1.0})
    inner = Inner(values=packed, factor=2.0)
    kinds = [make_outer(**change).bundle_type for change in (*changes, {"inner": inner})]
    assert len({first.bundle_type, *kinds}) == 6


def test_what_describes_a_bundle_serves_for_arrays_so_many_bytes_behind():
    values = np.array([[1.0, 2.0], [30.0, 40.0]])
    first, second = (Inner(values=row, factor=2.0) for row in values)
    second.lie_as(first, values.strides[0])
    assert add_up(second) == 140.0
    assert add_up(first) == 6.0


def test_a_state_is_described_as_if_each_of_its_arrays_had_been_looked_at():
    capacity = Capacity(egos=1, vehicles=2, walkers=1, props=1, junctions=1, signals=1)
    rows = np.zeros(3, state_dtype(capacity))
    for state in (views_of(rows[:1]), views_of(rows[2:]), views_of(rows[1:2].copy())):
        looked_at = State(*state)
        assert np.array_equal(state.bundle_block, looked_at.bundle_block)
        assert state.bundle_type is looked_at.bundle_type


def test_another_element_type_is_another_signature_not_a_misreading():
    expected = weighted(make_outer(), 1)
    compiled = len(weighted.signatures)
    single = make_outer(matrix=np.arange(6, dtype=np.float32).reshape(2, 3))
    assert weighted(single, 1) == expected
    assert len(weighted.signatures) == compiled + 1


@pytest.mark.parametrize("value", ["text", None, [1.0, 2.0], 1j])
def test_a_field_that_kernels_cannot_read_is_refused_by_name(value):
    message = rf"Outer\.matrix must be an array, .* got {type(value).__name__}"
    with pytest.raises(TypeError, match=message):
        weighted(make_outer(matrix=value), 1)


def test_a_name_that_is_no_field_is_refused_when_the_kernel_is_compiled():
    @numba.njit
    def misspelt(bundle):
        return bundle.matrx[0, 0]

    with pytest.raises(numba.TypingError, match="matrx"):
        misspelt(make_outer())


def test_arrays_live_as_long_as_their_bundle():
    outer = Outer(
        matrix=np.full((1000, 3), 2.0),
        index=np.arange(3, dtype=np.int32),
        scalar=np.array(0, np.int64),
        count=0,
        inner=Inner(values=np.zeros(1), factor=1.0),
    )
    weighted(outer, 0)
    for _ in range(100):  # would reuse memory that was given back
        np.full((1000, 3), 9.0)
    assert weighted(outer, 999) == 6.0


def test_the_bundles_of_a_town_survive_pickling_whole():
    lanes = load_town("toy").lanes
    again = pickle.loads(pickle.dumps(lanes))
    assert type(again) is type(lanes)
    assert all(np.array_equal(a, b) for a, b in zip(lanes, again, strict=True))


def test_a_state_and_its_read_only_view_are_of_one_type():
    capacity = Capacity(egos=1, vehicles=2, walkers=1, props=1, junctions=1, signals=1)
    record = np.zeros(1, state_dtype(capacity))
    state, frozen = views_of(record), views_of(record)
    for array in frozen:
        array.flags.writeable = False
    assert numba.typeof(state) == numba.typeof(frozen)
    larger = views_of(np.zeros(1, state_dtype(capacity._replace(vehicles=200))))
    assert numba.typeof(larger) == numba.typeof(state)
