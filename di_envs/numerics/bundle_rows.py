"""Bundles in a row: many of one kind that a kernel takes as one pointer, and reads by index.

A kernel that works on many worlds needs the bundle of each. Numba has no list of what goes by
reference, so a row is a block of addresses: `row[i]` in a kernel is the bundle at the i-th.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from functools import cached_property
from typing import Any, Generic, TypeVar

from di_envs.numerics.bundles import unboxed_by  # isort: skip (says how Numba knows bundles)
import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import (
    intrinsic,
    models,
    overload,
    register_model,
    typeof_impl,
    unbox,
)

Bundle = TypeVar("Bundle")


class BundleRow(Generic[Bundle]):
    """Bundles of one class, with arrays of the same types; Python reads them by index, too."""

    def __init__(self, bundles: Sequence[Bundle]) -> None:
        """A row of at least one.

        Raises:
            TypeError: If one is of another type than the first.
        """
        self._bundles = list(bundles)
        self.element = numba.typeof(bundles[0])
        self._addresses = np.zeros(len(self._bundles), np.int64)
        for index, bundle in enumerate(bundles):
            self[index] = bundle

    def __getitem__(self, index: int) -> Bundle:
        return self._bundles[index]

    def __setitem__(self, index: int, bundle: Bundle) -> None:
        added: Any = bundle
        if (found := numba.typeof(added)) != self.element:
            raise TypeError(f"All bundles of a row are of one type, {self.element}; got {found}.")
        self._bundles[index] = bundle
        self._addresses[index] = added.bundle_address

    @cached_property
    def row_address(self) -> int:
        """Of the block of addresses, which stays where it is."""
        return int(self._addresses.ctypes.data)


class BundleRowType(types.Type):
    """Numba's type of a row: that of its bundles."""

    def __init__(self, element: Any) -> None:
        self.element = element
        super().__init__(name=f"Row_{element.name}")


@typeof_impl.register(BundleRow)
def _row_type(row: BundleRow[Any], _context: object) -> BundleRowType:
    return BundleRowType(row.element)


@register_model(BundleRowType)
class _RowModel(models.OpaqueModel):
    """A pointer to the block of addresses."""


unbox(BundleRowType)(unboxed_by("row_address"))


@intrinsic
def _bundle_at(_context: Any, row: BundleRowType, index: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        at = context.cast(builder, values[1], signature.args[1], types.intp)
        addresses = builder.bitcast(values[0], ir.IntType(64).as_pointer())
        address = builder.load(builder.gep(addresses, [at]))
        return builder.inttoptr(address, context.get_value_type(signature.return_type))

    return row.element(row, index), build


@overload(operator.getitem)
def _get(row: Any, index: Any) -> Any:
    if not (isinstance(row, BundleRowType) and isinstance(index, types.Integer)):
        return None

    def bundle_of(row: Any, index: Any) -> Any:
        return _bundle_at(row, index)

    return bundle_of
